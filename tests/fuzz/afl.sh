#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# afl.sh MINUTES [TARGET]...: as run.sh, with AFL++ (Debian's afl++) in place of libFuzzer, for this many minutes per
# target. run.sh continues with its inputs; crashes are stored in build/afl/found/TARGET/.
set -euo pipefail
cd "$(dirname "$0")/../.."
seconds=$(($1 * 60))
shift
targets=("$@")
[[ ${#targets[@]} -gt 0 ]] || mapfile -t targets < <(basename -s .cpp -a tests/fuzz/*.cpp)
# Disables its terminal UI and its demands on the kernel configuration.
export AFL_NO_UI=1 AFL_SKIP_CPUFREQ=1 AFL_I_DONT_CARE_ABOUT_MISSING_CRASHES=1 AFL_NO_AFFINITY=1

build=$PWD/build/afl
CC=afl-clang-fast CXX=afl-clang-fast++ AFL_QUIET=1 cmake -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo \
  -DCMAKE_CXX_FLAGS="-fsanitize=address,undefined -fno-sanitize-recover=all" -DCMAKE_UNITY_BUILD=ON \
  -DCMAKE_UNITY_BUILD_BATCH_SIZE=0 -DLOCUS_COMPARE_WITH_PCL=OFF --log-level=WARNING
AFL_QUIET=1 cmake --build "$build" --target "${targets[@]/#/fuzz_}"
mkdir -p "$build/found"

for target in "${targets[@]}"; do
  found=$build/found/$target
  afl-fuzz -i "$build/tests/fuzz/corpus/$target" -o "$found" -V "$seconds" -m none -t 10000 -- "$build/bin/fuzz_$target" \
    &> "$build/$target.log" || { echo "$target: AFL++ did not run, see $build/$target.log" >&2 && exit 1; }
  stat() { sed -n "s/^$1 *: *//p" "$found/default/fuzzer_stats"; }
  last_find=$(stat last_find) started=$(stat start_time) # both of the clock; 0: none
  echo "$target: $(stat execs_done) inputs, $(stat edges_found) edges," \
    "the last new path after $((last_find > started ? last_find - started : 0)) s;" \
    "$(stat saved_crashes) broke something, $(stat saved_hangs) hung"
  mkdir -p "build/fuzz/found/$target"
  cp "$found"/default/queue/id* "build/fuzz/found/$target"
done
