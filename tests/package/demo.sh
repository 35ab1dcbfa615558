#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# demo.sh FOLDER: the package locus-demo-data of FOLDER is smaller than 6 MB; on a separate Debian, an ordinary user gets
# the report by locus-demo, also in a folder without write access, and errors that say what to do.
set -euo pipefail
folder=$(realpath "$1")
source "$(dirname "$(realpath "$0")")/base_tree.sh"
probe
deb=$(echo "$folder"/locus-demo-data_*_all.deb) tools=$(echo "$folder"/locus-tools_*.deb)
[ "$(dpkg-deb -f "$deb" Version)" = "$(dpkg-deb -f "$tools" Version)" ]
size=$(stat -c %s "$deb")
echo "$size bytes"
[ "$size" -lt 6000000 ]
base=$(base_tree "$folder")
work=$(mktemp -d -t locusd-demo.XXXXXX)
trap 'rm -rf "$work"' EXIT
cp "$deb" "$tools" "$work"

cat >"$work/inside.sh" <<'INSIDE'
set -euo pipefail
cd "$1"
dpkg -i ./*.deb >dpkg.log 2>&1 || { cat dpkg.log; exit 1; }
useradd --create-home driver
as_driver() { runuser -u driver -- env -u DISPLAY -u WAYLAND_DISPLAY HOME=/home/driver "$@"; }
cd /home/driver
as_driver locus-demo | tee said
grep -q "^run  .* 0 failed," said
[ "$(tail -n 1 said)" = "report     /home/driver/locus-demo/report.html" ]
for file in report.html summary.json odometry.tum map.pcd; do
  [ -s "locus-demo/$file" ]
done
grep -q '"ape_m"' locus-demo/summary.json
cd /usr
[ "$(as_driver locus-demo | tail -n 1)" = "report     /home/driver/.cache/locus-demo/report.html" ]
cmp /home/driver/{,.cache/}locus-demo/odometry.tum
refused() { # STATUS WHY ARGUMENT...
  local status=0
  as_driver locus-demo "${@:3}" >/home/driver/said 2>&1 || status=$?
  [ $status -eq "$1" ] && grep "$2" /home/driver/said
}
refused 2 "no such option" --fast
mv /usr/share/locus-demo/drive /usr/share/locus-demo/away
refused 1 "install the package locus-demo-data"
INSIDE
systemd-nspawn --quiet --directory="$base" --register=no --keep-unit --volatile=overlay --console=pipe --bind="$work" \
  bash "$work/inside.sh" "$work" </dev/null
