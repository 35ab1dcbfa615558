#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# coverage.sh TARGET [FOLDER]...: lists the branches in our code that are taken one way only by the corpus of a target,
# the seeds of seeds.py and the inputs in these folders, with the counts of each way (by Debian's llvm). Some cannot go
# the other way; the others need a seed.
set -euo pipefail
cd "$(dirname "$0")/../.."
target=$1
shift
build=$PWD/build/fuzz-coverage
counts=$build/$target

cmake --preset fuzz -B "$build" --log-level=WARNING \
  -DCMAKE_CXX_FLAGS="-fsanitize=fuzzer-no-link,address -fprofile-instr-generate -fcoverage-mapping" > /dev/null
cmake --build "$build" --target "fuzz_$target" > /dev/null
tests/fuzz/seeds.py "$build/seeds"
seeds=("$build/tests/fuzz/corpus/$target" "$build/seeds/$target" "$@")
[[ ! -d tests/fuzz/mended/$target ]] || seeds+=("tests/fuzz/mended/$target")
LLVM_PROFILE_FILE=$counts.profraw "$build/bin/fuzz_$target" -runs=0 "${seeds[@]}" &> "$counts.log"
llvm-profdata merge -o "$counts.profdata" "$counts.profraw"
llvm-cov show "$build/bin/fuzz_$target" -instr-profile="$counts.profdata" --show-branches=count \
  --show-instantiations=false -ignore-filename-regex='^/usr/' |
  awk -v here="$PWD/" -v there="$build/include/" '
    /^\/.*:$/ { file = $0; sub(there "[^/]*/", "", file); sub(here, "", file); sub(/:$/, "", file) }
    /^ *[0-9]+\|/ { line = $0; sub(/\|.*/, "", line); code = $0; sub(/^[^|]*\|[^|]*\|/, "", code); text[file, line + 0] = code }
    /Branch \(/ {
      match($0, /\([0-9]+:/); at = substr($0, RSTART + 1, RLENGTH - 2)
      match($0, /\[.*\]/); ways = substr($0, RSTART, RLENGTH)
      if ((ways ~ /True: 0,/) != (ways ~ /False: 0\]/) && text[file, at + 0] !~ /demand\(/ && !seen[file, at, ways]++)
        printf "%s:%d %s %s\n", file, at, ways, text[file, at + 0]
    }'
