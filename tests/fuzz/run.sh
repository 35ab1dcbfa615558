#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# run.sh MINUTES [TARGET]...: fuzzes each target (default: all), one after the other, until this many minutes of CPU
# time found no new coverage, and stores the minimal corpus of equal coverage in corpus/TARGET.tar.xz. It starts with
# that corpus and the seeds of seeds.py, and a repeated call resumes. afl.sh does the same with AFL++; coverage.sh
# reports the coverage.
#
# Crashing inputs are stored in build/fuzz/broken/, the reports in build/fuzz/log/TARGET:
#   build/fuzz/bin/fuzz_TARGET FILE                                    runs it again, with the trace
#   build/fuzz/bin/fuzz_TARGET -minimize_crash=1 -runs=100000 FILE     minimises it
# Fix the program, write a regression test, and copy the file to mended/TARGET/: every run of the tests then replays it.
set -euo pipefail
cd "$(dirname "$0")/../.."
asked_s=$(($1 * 60))
shift
targets=("$@")
[[ ${#targets[@]} -gt 0 ]] || mapfile -t targets < <(basename -s .cpp -a tests/fuzz/*.cpp)

cmake --preset fuzz --log-level=WARNING
cmake --build --preset fuzz
build=$PWD/build/fuzz
mkdir -p "$build/log" "$build/broken"
tests/fuzz/seeds.py "$build/seeds"

# The run that reproduces a failure records allocation stacks; here they would cost a third of the time.
export ASAN_OPTIONS=malloc_context_size=0

last() { grep -aoP "$1" "$log" | tail -n 1; }

for target in "${targets[@]}"; do
  corpus=$build/tests/fuzz/corpus/$target found=$build/found/$target merged=$build/merged/$target log=$build/log/$target
  mkdir -p "$corpus" "$found"
  seeds=("$corpus" "$build/seeds/$target")
  [[ ! -d tests/fuzz/mended/$target ]] || seeds+=("tests/fuzz/mended/$target")
  fuzzer=("$build/bin/fuzz_$target" -timeout=10 "-artifact_prefix=$build/broken/$target-")

  inputs=0 edges=0 at_first= quiet_s=0 round=0
  while ((quiet_s < asked_s)); do
    TIMEFORMAT='%0U %0S'
    if ! cpu=$({ time "${fuzzer[@]}" -max_total_time=300 -print_final_stats=1 "$found" "${seeds[@]}" &>"$log"; } 2>&1); then
      echo "$target: $(grep -aE 'runtime error|ERROR' "$log" | head -n 1), see $log"
      break
    fi
    inputs=$((inputs + $(last 'number_of_executed_units: \K\d+')))
    reached=$(last 'cov: \K\d+')
    : "${at_first:=$(grep -aoP 'INITED cov: \K\d+' "$log")}"
    if ((reached > edges && (round > 0 || reached > at_first))); then quiet_s=0; else quiet_s=$((quiet_s + ${cpu/ / + })); fi
    edges=$((reached > edges ? reached : edges)) round=$((round + 1))
    echo "$target: $inputs inputs, $edges edges ($at_first at first), none of them new for $((quiet_s / 60)) minutes of CPU"
  done

  rm -rf "$merged" && mkdir -p "$merged"
  "${fuzzer[@]}" -set_cover_merge=1 -use_counters=0 -max_len=16384 "$merged" "$corpus" "$build/seeds/$target" "$found" &>> "$log"
  tar --sort=name --owner=0 --group=0 --numeric-owner --mtime=@0 -cJf "tests/fuzz/corpus/$target.tar.xz" \
    -C "$merged" .
done
