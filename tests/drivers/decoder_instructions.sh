#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# decoder_instructions.sh BIN [--accept]: compares the instructions per return with the last accepted numbers. Unlike
# the run time, they are reproducible. Fails above +3 %.
set -euo pipefail
bin=$1 accept=${2:-}
accepted=$(dirname "$(realpath "$0")")/decoder_instructions.txt
measured=$(mktemp)
trap 'rm -f "$measured"*' EXIT

valgrind --tool=callgrind --instr-atstart=no --collect-atstart=no --callgrind-out-file="$measured.dump" \
  "$bin/decoder_instructions" >"$measured.returns" 2>"$measured.log" || { cat "$measured.log" >&2; exit 1; }
dump=0
while read -r packet returns; do
  dump=$((dump + 1))
  total=$(sed -n 's/^totals: \([0-9]*\).*/\1/p' "$measured.dump.$dump")
  printf '%-36s %6s\n' "$packet" "$(awk "BEGIN { printf \"%.1f\", $total / $returns }")" >>"$measured"
done <"$measured.returns"

if [ "$accept" = --accept ]; then
  cp "$measured" "$accepted"
fi
join --nocheck-order "$accepted" "$measured" | awk -v kinds="$(wc -l <"$accepted")" '
  { change = 100 * ($3 / $2 - 1); bad += change > 3
    printf "%-36s %6.1f instructions per return, were %6.1f: %+.1f %%\n", $1, $3, $2, change }
  END { if (NR != kinds) { print "a kind of packet is missing"; exit 1 }
        if (bad) { print "more than 3 % more; where that is worth it: tests/drivers/decoder_instructions.sh BIN --accept"; exit 1 } }'
