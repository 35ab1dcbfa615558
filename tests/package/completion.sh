#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# completion.sh BIN COMPLETION: tests bash completion for the programs of BIN.
set -euo pipefail
export PATH=$1:$PATH
set +u
source /usr/share/bash-completion/bash_completion
source "$2"
status=0

# offered WORD...: prints the completions of the last word.
offered() {
  COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMP_LINE="$*" COMPREPLY=()
  COMP_POINT=${#COMP_LINE}
  _locus "$1" "${!#}" "${COMP_WORDS[COMP_CWORD - 1]}"
  printf '%s\n' "${COMPREPLY[@]}" | sort | xargs
}
# expect WANTED WORD...
expect() {
  local wanted=$1
  shift
  local found=$(offered "$@")
  [ "$found" = "$wanted" ] || { echo "$*<TAB>: offers '$found', not '$wanted'"; status=1; }
}

for program in locusd locusctl locus-demo locus-experiments locus-play locus-replay locus-sim; do
  expect "$("$program" --help | grep -oP '^  (-.,)?\K--[a-z-]+' | sort | xargs)" "$program" --
done
expect "calibration fetch flat-ground record reload reset save-map sensors status view" locusctl ""
expect "save-map" locusctl --instance front sa
expect "--help --instance --json --socket --watch" locusctl status --
expect "auto off on" locusctl flat-ground ""
expect "corridor field road stairs tunnel urban" locus-sim --world ""
expect "tunnel" locus-sim --seed 3 --world t
cd "$(mktemp -d)" && touch drive.pcap
expect "drive.pcap" locus-replay -o out dri
expect "drive.pcap" locus-replay --imu d
rm -r "$PWD"
exit $status
