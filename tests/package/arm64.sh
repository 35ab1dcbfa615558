#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# arm64.sh SOURCE BIN SUITE: cross-builds the packages of the release SUITE for arm64 and runs their programs under
# QEMU; a replay must agree with that of the programs of BIN.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
source=$(realpath "$1") bin=$(realpath "$2") suite=$3
source "$here/base_tree.sh"
probe
[ "$(dpkg --print-architecture)" != arm64 ] || skip "this is an arm64; the other tests are about it"

work=$(mktemp -d -t locusd-arm64.XXXXXX)
trap 'rm -rf "$work"' EXIT
cd "$work"
in_tree() { "$source/packaging/build-tree.sh" "$suite" arm64 "$work" "$@"; }
in_tree true || skip "there is no Debian to build for arm64 in, see above"
in_tree /usr/aarch64-linux-gnu/lib/ld-linux-aarch64.so.1 --version >/dev/null ||
  skip "programs of arm64 cannot be run: that needs Linux 6.7 or, outside, the package qemu-user-static"
cp -r "$source/packaging" .
DEB_BUILD_PROFILES="cross nocheck" in_tree packaging/install-build-deps.sh arm64 >log 2>&1 ||
  { tail log; skip "the libraries of arm64 could not be installed; is there a network?"; }

"$source/packaging/build-deb.sh" --suite "$suite" --arch arm64 "$work/deb"
"$here/contents.sh" "$source" "$work/deb"
for package in locusd locus-tools; do
  dpkg-deb -x "$work/deb/$package"_*_arm64.deb "$work/root"
done
for program in "$work"/root/usr/bin/*; do
  in_tree "$program" --version
done

# Results are bit-identical for any number of threads on one architecture, but not across architectures: arm64 uses
# fused multiply-add and other implementations of mathematical functions, so that a point may fall on the other side of
# a threshold. The differences are tenths of a millimetre; a real error would exceed 3 mm or 1 mrad.
"$bin/locus-sim" --world urban --robot husky --seed 1 --duration 10 --realism clean -o "$work/drive" >/dev/null 2>&1
"$bin/locus-replay" --quiet -o "$work/here" "$work/drive"
for threads in 1 2; do
  in_tree "$work/root/usr/bin/locus-replay" --quiet --threads $threads -o "$work/arm64-$threads" "$work/drive"
done
cmp "$work"/arm64-{1,2}/odometry.tum
cmp "$work"/arm64-{1,2}/map.pcd
paste -d ' ' "$work"/{here,arm64-1}/odometry.tum | awk '
  function apart(first, last) {
    sum = 0
    for (i = first; i <= last; ++i) sum += ($i - $(i + 8)) ^ 2
    return sqrt(sum)
  }
  $1 != $9 { others++ }
  apart(2, 4) > worst_m { worst_m = apart(2, 4) }
  2 * apart(5, 8) > worst_rad { worst_rad = 2 * apart(5, 8) }
  END {
    printf "%d poses, %d at other times, at most %.2f mm and %.3f mrad apart\n", NR, others, 1e3 * worst_m,
      1e3 * worst_rad
    exit !(NR >= 98 && !others && worst_m < 3e-3 && worst_rad < 1e-3)
  }'
