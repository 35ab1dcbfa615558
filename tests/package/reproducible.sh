#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# reproducible.sh SOURCE FOLDER: the packages built again, in another folder, are the same to the byte. The compiler's
# cache may help: that objects do not hold the folder's name or the hour is what contents.sh and -Wdate-time see to.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT
"$1/packaging/build-deb.sh" "$work"
status=0
for deb in "$2"/*.deb; do
  cmp "$deb" "$work/$(basename "$deb")" || status=1
done
exit $status
