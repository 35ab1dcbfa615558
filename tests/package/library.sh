#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# library.sh SOURCE BIN FOLDER: compiles the C++ example with liblocus-dev of FOLDER and runs the Python one with
# python3-locus in a separate Debian; both must print the results of the programs of BIN here.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
source=$(realpath "$1") bin=$(realpath "$2") folder=$(realpath "$3")
source "$here/base_tree.sh"
probe
base=$(base_tree "$folder" g++ pkgconf $(library_depends "$folder"))
work=$(mktemp -d -t locusd-library.XXXXXX)
trap 'rm -rf "$work"' EXIT
"$bin/locus-sim" --world urban --robot husky --seed 1 --duration 10 --realism clean -o "$work/drive" >/dev/null 2>&1
"$bin/locus-replay" --quiet -o "$work/here" "$work/drive"
cp "$folder"/{liblocus0,liblocus-dev,python3-locus}_*.deb "$source"/docs/examples/replay.{cpp,py} "$work"

cat >"$work/inside.sh" <<'INSIDE'
set -euo pipefail
cd "$1"
dpkg -i ./*.deb >dpkg.log 2>&1 || { cat dpkg.log; exit 1; }
g++ -std=c++20 -Wall -Wextra -Werror replay.cpp -o replay $(pkg-config --cflags --libs liblocus)
./replay drive >cpp
python3 replay.py drive >python
cmp cpp python
INSIDE
systemd-nspawn --quiet --directory="$base" --register=no --keep-unit --volatile=overlay --console=pipe --bind="$work" \
  bash "$work/inside.sh" "$work" </dev/null
paste -d ' ' "$work/here/odometry.tum" "$work/cpp" | awk '
  { for (i = 1; i <= 8; ++i) if (($i - $(i + 8)) ^ 2 > 1e-10) others++ }
  END { printf "%d poses, %d numbers otherwise\n", NR, others; exit !(NR >= 98 && !others) }'
