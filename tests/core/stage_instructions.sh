#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# stage_instructions.sh BIN [--accept]: compares the instructions per sweep with the last accepted numbers. Unlike the
# run time, they are reproducible. Fails above +3 %.
set -euo pipefail
bin=$1 accept=${2:-}
accepted=$(dirname "$(realpath "$0")")/stage_instructions.txt
measured=$(mktemp)
trap 'rm -f "$measured"*' EXIT

# Scan-to-scan runs only at the start.
valgrind --tool=callgrind --instr-atstart=no --collect-atstart=no --callgrind-out-file="$measured.dump" \
  "$bin/stage_instructions" all decode correct filter covariance scan_to_submap map \
  >"$measured.sweeps" 2>"$measured.log" || { cat "$measured.log" >&2; exit 1; }
dump=0
while read -r stage sweeps; do
  dump=$((dump + 1))
  total=$(sed -n 's/^totals: \([0-9]*\).*/\1/p' "$measured.dump.$dump")
  printf '%-15s %9d\n' "$stage" $((total / sweeps)) >>"$measured"
done <"$measured.sweeps"

if [ "$accept" = --accept ]; then
  cp "$measured" "$accepted"
fi
join --nocheck-order "$accepted" "$measured" | awk '
  { change = 100 * ($3 / $2 - 1); bad += change > 3
    printf "%-15s %9d instructions per sweep, were %9d: %+.1f %%\n", $1, $3, $2, change }
  END { if (NR != 7) { print "a stage is missing"; exit 1 }
        if (bad) { print "more than 3 % more; where that is worth it: tests/core/stage_instructions.sh BIN --accept"; exit 1 } }'
