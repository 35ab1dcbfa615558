#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# repeat.sh RUNS [--beside COMMAND] [CTEST OPTIONS...]: runs the tests of the preset quick RUNS times, one run after the
# other, beside a command that loads the machine. Each run is a row of build/repeats.md. Rows that the table has already
# of the same commit, command and options count, so that an interrupted series continues on the next call. Build first.
# Exit status: 1 if a test failed in a row of the series; the output of a failed run is beside the table.
#   tests/repeat.sh 25 --beside 'stress-ng --cpu 4 --io 2' -L 'threads|processes'
set -euo pipefail
cd "$(dirname "$0")/.."
runs=${1:?usage: repeat.sh RUNS [--beside COMMAND] [CTEST OPTIONS...]}
shift
beside=
if [ "${1-}" = --beside ]; then
  beside=${2:?--beside: a command is missing}
  shift 2
fi
table=build/repeats.md
mkdir -p build
[ -e "$table" ] || printf '%s\n' '| commit | beside | options of ctest | begin (UTC) | load | minutes | tests | failed |' \
  '|---|---|---|---|---|---|---|---|' >"$table"
options="$*"
series="| $(git describe --always --dirty --exclude '*') | $beside | ${options//|/\\|} |"
rows() { grep -F -- "$series" "$table" || true; }

load_pid=
end_load() {
  [ -z "$load_pid" ] || kill -- "-$load_pid" 2>/dev/null || true
  load_pid=
}
trap end_load EXIT

for ((run = $(rows | wc -l); run < runs; ++run)); do
  if [ -n "$beside" ]; then
    setsid bash -c "$beside" >/dev/null 2>&1 &
    load_pid=$!
  fi
  begin=$(date -u '+%F %R') begin_s=$SECONDS log=build/repeat-$(date -u +%FT%H%M%S).log
  ctest --preset quick --parallel "$(nproc)" "$@" >"$log" 2>&1 || true
  end_load
  tests=$(sed -nE 's/.*tests failed out of ([0-9]+)$/\1/p' "$log")
  [ -n "$tests" ] || { echo "repeat.sh: ctest ran no tests; see $log" >&2 && exit 2; }
  failed=$(sed -nE '/\(Skipped\)$/d; s/^\t *[0-9]+ - (\S+) \((.*)\)( .*)?$/\1 (\2)/p' "$log" | paste -sd, | sed 's/,/, /g')
  printf '%s %s | %s | %s | %s | %s |\n' "$series" "$begin" "$(cut -d' ' -f1 /proc/loadavg)" \
    "$(awk -v s=$((SECONDS - begin_s)) 'BEGIN { printf "%.1f", s / 60 }')" "$tests" "${failed:--}" | tee -a "$table"
  [ -n "$failed" ] || rm "$log"
done
! rows | grep -qv -- ' - |$'
