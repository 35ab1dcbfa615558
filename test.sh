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

# Whether all that failed in this build is live: such a test may be held up by whoever else is on the host of CI's machine.
only_live_tests_failed() {
  local failed=$1/Testing/Temporary/LastTestsFailed.log live
  live=$(ctest --test-dir "$1" -N -L threads | sed -n 's/.*Test *#[0-9]*: //p')
  [ -z "$(comm -23 <(cut -d: -f2- "$failed" | sort) <(sort <<<"$live"))" ]
}

packaging/install-build-deps.sh
for preset in "${presets[@]}"; do
  cmake --preset "$preset" --log-level=WARNING
  cmake --build --preset "$preset"
  build=build/$preset
  [ "$preset" = dev ] && preset=$tests
  ctest --preset "$preset" --parallel "$(nproc)" || {
    status=$?
    [ -n "${CI:-}" ] && only_live_tests_failed "$build" && ctest --preset "$preset" --rerun-failed || exit $status
  }
done
