#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# demo.sh [CAPTURE]: builds locus-replay and runs it on a capture, a pcap file or a capture folder; without one, on a
# robot that it first lets drive through a simulated power plant for a minute. Prints the figures and where the report
# lies.
set -euo pipefail
capture=${1:+$(realpath -e "$1")} # says so at once if there is none
cd "$(dirname "$0")"

packaging/install-build-deps.sh
cmake --preset release --log-level=WARNING
cmake --build --preset release --target locus-replay locus-sim
bin=build/release/bin
result=build/demo

if [ -z "$capture" ]; then
  capture=$result/plant
  "$bin/locus-sim" --world urban --robot husky --duration 60 --seed 1 -o "$capture"
fi
"$bin/locus-replay" -o "$result/odometry" "$capture"

echo
echo "Look at $PWD/$result/odometry/report.html in any browser. Beside it:"
echo "  odometry.tum   where the robot was at the end of each sweep"
echo "  odometry.csv   how sure of it, and why"
echo "  map.pcd        what it saw"
echo "  summary.json   losses, counts, times"
