#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# manual.sh BIN PAGE...: the manual pages list exactly the options and commands of --help of the programs of BIN; that
# of the configuration is valid and has every key with its default. groff reports no error.
set -euo pipefail
bin=$1
shift
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT
status=0
complain() { echo "$*"; status=1; }

for page in "$@"; do
  LC_ALL=C.UTF-8 MANWIDTH=120 man --warnings --local-file -E UTF-8 -Tutf8 -Z "$page" >/dev/null 2>"$work/warnings"
  [ ! -s "$work/warnings" ] || complain "$page: $(cat "$work/warnings")"

  name=$(basename "${page%.[0-9]}")
  if [ "$name" = locusd.yaml ]; then
    sed '/^\.Bd -literal$/,/^\.Ed/ !d' "$page" | sed -e '/^\.Ed/,$ d' -e '1d' -e 's/\\-/-/g; s/\\e/\\/g' >"$work/page.yaml"
    "$bin/locusd" --print-config >"$work/defaults.yaml"
    "$bin/locusd" --config "$work/page.yaml" --print-config | diff "$work/defaults.yaml" - ||
      complain "$page: shows other values than the defaults (>)"
    for key in $(grep -oP '\w+(?=:( |$))' "$work/defaults.yaml" | sort -u); do
      grep -q "\b$key:" "$work/page.yaml" || complain "$page: lacks the key $key"
    done
    continue
  fi

  "$bin/$name" --help >"$work/help"
  commands=$(sed -n '/^Subcommands:/,/^$/ s/^  \([a-z-]\+\) .*/\1/p' "$work/help")
  for command in $commands; do
    "$bin/$name" "$command" --help >>"$work/help"
  done
  diff <(grep -oP '^  (-.,)?\K--[a-z-]+' "$work/help" | sort -u) \
    <(grep '^\.It ' "$page" | grep -oP ' \K-[a-z][a-z-]+' | sed 's/^/-/' | sort -u) ||
    complain "$page: has other options (>) than $name --help (<)"
  diff <(sed "/^$/d" <<<"$commands" | sort) <(grep -oP '^\.It Cm \K[a-z-]+' "$page" | sort) ||
    complain "$page: has other commands (>) than $name --help (<)"
done
exit $status
