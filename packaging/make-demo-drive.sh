#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# make-demo-drive.sh LOCUS_SIM FOLDER: simulates the drive of the package locus-demo-data into FOLDER: a car on a road
# with all imperfections, one VLP-16. 14 s stay below 6 MB; the true map, which is as large, is left out. The same
# program makes the same bytes.
set -euo pipefail
"$1" --world road --robot car --duration 14 --seed 1 -o "$2" >/dev/null
rm "$2/gt_map.ply"
xz --extreme -9 --threads=1 "$2/lidar.pcap"
