#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Prints the trajectory of the robot in TUM format (t x y z qx qy qz qw), and the size of the map.

python3 replay.py drive.pcap
"""
import math
import sys

import locus


def main() -> int:
    if len(sys.argv) != 2:
        print("usage: replay.py RECORDING", file=sys.stderr)
        return 2
    try:
        replay = locus.replay(sys.argv[1])
        sigma_m = 0.0
        for estimate in replay:
            numbers = [*estimate.position, *estimate.orientation_xyzw]
            seconds, ns = divmod(estimate.stamp_ns, 10**9)
            print(f"{seconds}.{ns:09}", *(f"{number:.6f}" for number in numbers))
            sigma_m = math.sqrt(estimate.pose_covariance[0, 0] + estimate.pose_covariance[1, 1])
        print(f"{len(replay.map())} surfaces, 1 sigma {sigma_m:.3f} m", file=sys.stderr)
        for warning in replay.warnings():
            print(f"warning: {warning}", file=sys.stderr)
    except locus.Error as error:
        print(error, file=sys.stderr)
        return 1
    return 0


sys.exit(main())
