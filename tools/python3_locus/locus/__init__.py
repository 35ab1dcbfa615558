# SPDX-License-Identifier: Apache-2.0
"""Lidar odometry: packets or clouds, IMU and odometry in, the pose of the robot out.

    import locus

    for estimate in locus.replay("drive.pcap"):
        print(estimate.stamp_ns, estimate.position, estimate.state)

The same inputs give the same bits as the program locus-replay. Stamps are integers, nanoseconds since 1970; lengths are
metres, angles radians. The frame "odom" begins level where the robot begins; "base" is that of the robot, x forward, z up.
An object may be used by several threads, one after the other has finished its call; computing releases the interpreter's
lock.
"""

from locus._native import Error, Estimate, Odometry, Replay, SourceEstimate, replay

__all__ = ["Error", "Estimate", "Odometry", "Replay", "SourceEstimate", "replay"]
