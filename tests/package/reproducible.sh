#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# reproducible.sh SOURCE FOLDER: a rebuild of the packages in another folder is identical to the byte. The compiler's
# cache may be used: contents.sh and -Wdate-time ensure that objects contain neither the folder's name nor the time.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT
"$1/packaging/build-deb.sh" "$work"
status=0
for deb in "$2"/*.deb; do
  cmp "$deb" "$work/$(basename "$deb")" || status=1
done
exit $status
