#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Every library bundled into a page is listed in its licences.txt and in the copyright file of the packages.
source "$(dirname "$0")/sources.sh"
export NODE_PATH=/usr/share/nodejs:/usr/share/javascript
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT
status=0
for page in tools/locus_replay/report tools/locus_experiments/page tools/locusctl/view/page; do
  esbuild "$page/main.js" --bundle --metafile="$work/meta.json" --outfile="$work/bundle.js" --log-level=warning
  libraries=$(grep -oP 'usr/share/(nodejs|javascript)/\K[^/"]+' "$work/meta.json" | sort -u)
  [ -n "$libraries" ] || { echo "$page: bundles nothing; is this check out of date?"; exit 1; }
  for library in $libraries; do
    for notice in "$page/licences.txt" packaging/debian/copyright; do
      if ! grep -qE -e "(^|[^a-z-])(${library}|${library#d3}|${library}\.js)([^a-z-]|$)" "$notice"; then
        echo "$notice: lacks $library, which $page/main.js bundles"
        status=1
      fi
    done
  done
done
exit $status
