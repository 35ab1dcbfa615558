#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# test.sh [--all | --timing]: installs what is missing, builds everything and runs tests. Ends with the summary of ctest,
# and with its exit status.
#   (nothing)  every test of seconds whose result depends on its inputs alone, however busy the machine is: the gate of a
#              change. Where it passes on a clean tree the commit is written to build/tested.
#   --all      these, and again under the address, undefined-behaviour and thread sanitizers, with clang-tidy, packages,
#              browsers and long drives: before a release.
#   --timing   what is measured in real time: latency, throughput, losslessness. One test at a time; keep the machine idle.
set -euo pipefail
cd "$(dirname "$0")"
case $#$* in
  0) presets=(quick) ;;
  1--all) presets=(asan tsan dev) ;;
  1--timing) presets=(timing) ;;
  *) echo "test.sh: wrong arguments: $*; usage: ./test.sh [--all | --timing]" >&2 && exit 2 ;;
esac

rm -f build/tested
packaging/install-build-deps.sh
export CCACHE_BASEDIR=$PWD # a clone at any place finds the objects of another
for preset in "${presets[@]}"; do
  build=$preset parallel=$(nproc)
  case $preset in
    quick) build=dev ;;
    timing) build=dev parallel=1 ;;
  esac
  cmake --preset "$build" --log-level=WARNING
  cmake --build --preset "$build"
  ctest --preset "$preset" --parallel "$parallel"
done
if [ "${presets[*]}" != timing ] && [ -z "$(git status --porcelain 2>&1)" ]; then
  git rev-parse HEAD >build/tested
fi
