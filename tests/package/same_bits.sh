#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# same_bits.sh BIN FOLDER: replays a drive with the programs of FOLDER, in a Debian of their own release, and with those
# of BIN here: different compilers and libraries must give the same poses and map, to the bit.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
bin=$(realpath "$1") folder=$(realpath "$2")
source "$here/base_tree.sh"
probe
base=$(base_tree "$folder")
work=$(mktemp -d -t locusd-bits.XXXXXX)
trap 'rm -rf "$work"' EXIT
dpkg-deb -x "$folder"/locus-tools_*.deb "$work/root"

"$bin/locus-sim" --world urban --robot husky --seed 1 --duration 20 -o "$work/drive" >/dev/null 2>&1
"$bin/locus-replay" --quiet -o "$work/here" "$work/drive"
systemd-nspawn --quiet --directory="$base" --register=no --keep-unit --volatile=overlay --console=pipe --bind="$work" \
  "$work/root/usr/bin/locus-replay" --quiet -o "$work/there" "$work/drive" </dev/null
for file in odometry.tum map.pcd; do
  cmp "$work/here/$file" "$work/there/$file"
done
