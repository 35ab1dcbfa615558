#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# instruction_counts.sh SCRIPT BIN ACCEPT UNIT NAME COUNT PROGRAM [ARG]...: counts the instructions of BIN/PROGRAM per
# UNIT by callgrind, and compares them with the last accepted counts, in the .txt beside SCRIPT. Unlike the run time,
# they are reproducible. Fails above +3 %. PROGRAM prints name and number of units of each of callgrind's dumps. ACCEPT:
# --accept to store the new counts, or empty. NAME, COUNT: formats of printf.
set -euo pipefail
script=$1 bin=$2 accept=$3 unit=$4 name_format=$5 count_format=$6 program=$7
shift 7
accepted=$(realpath "${script%.sh}.txt")
measured=$(mktemp)
trap 'rm -f "$measured"*' EXIT

valgrind --tool=callgrind --instr-atstart=no --collect-atstart=no --callgrind-out-file="$measured.dump" \
  "$bin/$program" "$@" >"$measured.units" 2>"$measured.log" || { cat "$measured.log" >&2; exit 1; }
dump=0
while read -r name units; do
  dump=$((dump + 1))
  total=$(sed -n 's/^totals: \([0-9]*\).*/\1/p' "$measured.dump.$dump")
  awk -v name="$name" -v count="$total" -v units="$units" -v format="$name_format $count_format\n" \
    'BEGIN { printf format, name, count / units }' >>"$measured"
done <"$measured.units"

if [ "$accept" = --accept ]; then
  cp "$measured" "$accepted"
fi
join --nocheck-order "$accepted" "$measured" | awk -v expected="$(wc -l <"$accepted")" -v script="${script##*/tests/}" \
  -v format="$name_format $count_format instructions per $unit, were $count_format: %+.1f %%\n" '
  { change = 100 * ($3 / $2 - 1); bad += change > 3
    printf format, $1, $3, $2, change }
  END { if (NR != expected) { print "a count is missing"; exit 1 }
        if (bad) { print "more than 3 % more; where that is worth it: tests/" script " BIN --accept"; exit 1 } }'
