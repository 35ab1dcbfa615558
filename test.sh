#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# test.sh [--all]: installs what is missing, builds everything, runs the tests that find a mistake in ordinary work. With
# --all every test: under the address and undefined-behaviour sanitizers with clang-tidy, those of the live threads under
# the thread sanitizer, packages and long drives. Ends with the summary of ctest, and with its exit status.
set -euo pipefail
cd "$(dirname "$0")"
case $#$* in
  0) presets=(dev) tests=quick ;;
  1--all) presets=(asan tsan dev) tests=dev ;;
  *) echo "test.sh: wrong arguments: $*; usage: ./test.sh [--all]" >&2 && exit 2 ;;
esac

packaging/install-build-deps.sh
for preset in "${presets[@]}"; do
  cmake --preset "$preset" --log-level=WARNING
  cmake --build --preset "$preset"
  [ "$preset" = dev ] && preset=$tests
  ctest --preset "$preset" --parallel "$(nproc)"
done
