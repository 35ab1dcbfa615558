#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# run.sh SECONDS [TARGET]...: fuzzes each target (all of them, if none is named) for so long, one after the other, and
# leaves in corpus/TARGET/ the fewest inputs that reach all the code that any input reached.
#
# A target is tests/fuzz/TARGET.cpp with libFuzzer's entry, so AFL++ takes it as it is:
#   cmake -B build/afl -DCMAKE_C_COMPILER=afl-clang-fast -DCMAKE_CXX_COMPILER=afl-clang-fast++ \
#     -DCMAKE_CXX_FLAGS=-fsanitize=address -DLOCUS_COMPARE_WITH_PCL=OFF && cmake --build build/afl --target fuzz_targets
#   afl-fuzz -i tests/fuzz/corpus/TARGET -o build/afl/found -- build/afl/bin/fuzz_TARGET
#
# An input that breaks something is kept in build/fuzz/broken/, the reason in build/fuzz/log/TARGET:
#   build/fuzz/bin/fuzz_TARGET FILE                                    runs it again, with the trace
#   build/fuzz/bin/fuzz_TARGET -minimize_crash=1 -runs=100000 FILE     makes it small
# Mend the program, write a test that tells the story, and copy the file to mended/TARGET/: from then on every run of the
# tests feeds it. Where the form of the input of a target has changed, seeds.py makes new ones.
set -euo pipefail
cd "$(dirname "$0")/../.."
seconds=$1
shift
targets=("$@")
[[ ${#targets[@]} -gt 0 ]] || mapfile -t targets < <(basename -s .cpp -a tests/fuzz/*.cpp)

cmake --preset fuzz --log-level=WARNING
cmake --build --preset fuzz
build=$PWD/build/fuzz
mkdir -p "$build/log" "$build/broken"
for target in "${targets[@]}"; do
  corpus=tests/fuzz/corpus/$target found=$build/found/$target merged=$build/merged/$target
  mkdir -p "$corpus" "$found"
  seeds=("$corpus")
  [[ ! -d tests/fuzz/mended/$target ]] || seeds+=("tests/fuzz/mended/$target")
  fuzzer=("$build/bin/fuzz_$target" -timeout=10 "-artifact_prefix=$build/broken/$target-")
  if "${fuzzer[@]}" "-max_total_time=$seconds" -print_final_stats=1 "$found" "${seeds[@]}" \
    &> "$build/log/$target"; then
    echo "$target: $(grep -a DONE "$build/log/$target")"
  else
    echo "$target: $(grep -aE 'runtime error|ERROR' "$build/log/$target" | head -n 1), see $build/log/$target"
  fi
  rm -rf "$merged" && mkdir -p "$merged"
  "${fuzzer[@]}" -set_cover_merge=1 -use_counters=0 -max_len=8192 "$merged" "$corpus" "$found" &>> "$build/log/$target"
  rm -f "$corpus"/* && cp "$merged"/* "$corpus"
done
