# SPDX-License-Identifier: Apache-2.0
"""python_test.py LOCUS_REPLAY DRIVES: the package locus equals locus-replay bit by bit, and no input crashes it."""
import csv
import gc
import json
import math
import struct
import subprocess
import sys
import tempfile
import threading
import unittest
from collections.abc import Callable, Iterator
from pathlib import Path

import locus
import numpy as np
from numpy.typing import NDArray

PROGRAM = Path(sys.argv[1])
DRIVES = Path(sys.argv[2])
ROOM = DRIVES / "room"
NOW_NS = 1_700_000_000_000_000_000
Row = dict[str, str]


def datagrams(pcap: Path) -> Iterator[tuple[int, bytes, int, int]]:
    """Yields arrival, payload, port and sender of the datagrams in a nanosecond pcap of Ethernet without tags."""
    data = pcap.read_bytes()
    assert struct.unpack_from("<I", data)[0] == 0xA1B23C4D
    at = 24
    while at < len(data):
        seconds, nanoseconds, length, _ = struct.unpack_from("<IIII", data, at)
        frame = data[at + 16 : at + 16 + length]
        at += 16 + length
        udp = 14 + 4 * (frame[14] & 15)
        (sender,) = struct.unpack_from(">I", frame, 26)
        port, size = struct.unpack_from(">HH", frame, udp + 2)
        yield seconds * 10**9 + nanoseconds, frame[udp + 8 : udp + size], port, sender


def rows(folder: Path) -> list[tuple[list[float], Row]]:
    """Returns the rows of odometry.tum without their times, and of odometry.csv."""
    poses = [[float(word) for word in line.split()[1:]] for line in (folder / "odometry.tum").read_text().splitlines()]
    with (folder / "odometry.csv").open() as file:
        return list(zip(poses, csv.DictReader(file), strict=True))


class SameBits(unittest.TestCase):
    def program(self, recording: Path, *options: str) -> list[tuple[list[float], Row]]:
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([PROGRAM, "--quiet", *options, "-o", folder, recording], check=True)
            return rows(Path(folder))

    def expect_same(self, estimates: list[locus.Estimate], expected: list[tuple[list[float], Row]]) -> None:
        self.assertGreater(len(expected), 50)
        self.assertEqual(len(estimates), len(expected))
        axes = ["x", "y", "z", "roll", "pitch", "yaw"]
        for estimate, (pose, row) in zip(estimates, expected):
            self.assertEqual([*estimate.position, *estimate.orientation_xyzw], pose)
            self.assertEqual(estimate.stamp_ns, int(row["t_ns"]))
            self.assertEqual((estimate.state, estimate.prior), (row["state"], row["source"]))
            self.assertEqual((estimate.iterations, estimate.inliers), (int(row["iterations"]), int(row["inliers"])))
            for i, first in enumerate(axes):
                for j, second in enumerate(axes):
                    self.assertEqual(estimate.pose_covariance[i, j], float(row[f"cov_{first}_{second}"]))
            for source in estimate.sources:
                for i, axis in enumerate(axes):
                    self.assertEqual(source.innovation[i], float(row[f"{source.name}_innovation_{axis}"]))
                    self.assertEqual(source.innovation_sigma[i], float(row[f"{source.name}_sd_{axis}"]))
                self.assertEqual(source.test_ratio, float(row[f"{source.name}_test_ratio"]))
                self.assertEqual(source.last_used_ns, int(row[f"{source.name}_last_used_ns"]))

    def test_replay(self) -> None:
        replay = locus.replay(ROOM)
        self.expect_same(list(replay), self.program(ROOM))
        self.assertEqual(list(replay), [])
        self.assertEqual(json.loads(replay.figures_json())["sweeps"]["failed"], 0)

    def test_replay_of_a_part_with_settings(self) -> None:
        settings = ["motion_sources=[]", "threads=1"]
        part = list(locus.replay(str(ROOM), set=settings, start=1, duration=6.5))
        options = [word for setting in settings for word in ("--set", setting)]
        self.expect_same(part, self.program(ROOM, *options, "--start", "1", "--duration", "6.5"))

    def test_packet_by_packet(self) -> None:
        odometry = locus.Odometry(set=["motion_sources=[]"])
        estimates = []
        for arrival_ns, payload, port, sender in datagrams(ROOM / "lidar.pcap"):
            estimates += odometry.packet(payload, arrival_ns, port, sender)
        estimates += odometry.finish()
        self.expect_same(estimates, self.program(ROOM / "lidar.pcap", "--set", "motion_sources=[]"))
        self.assertEqual((odometry.scan().dtype, odometry.scan().shape[1]), (np.float32, 3))
        self.assertEqual((odometry.map().dtype, odometry.map().shape[1]), (np.float32, 6))
        self.assertGreater(len(odometry.map()), 100)

    def test_threads_compute_in_parallel_and_independently(self) -> None:
        found: list[list[locus.Estimate]] = []
        threads = [threading.Thread(target=lambda: found.append(list(locus.replay(ROOM)))) for _ in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        expected = self.program(ROOM)
        for estimates in found:
            self.expect_same(estimates, expected)

    def test_one_object_in_several_threads(self) -> None:
        replay = locus.replay(ROOM)
        found: list[locus.Estimate] = []
        threads = [threading.Thread(target=lambda: found.extend(replay)) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.expect_same(sorted(found, key=lambda estimate: estimate.stamp_ns), self.program(ROOM))


class Inputs(unittest.TestCase):
    def test_estimate_outlives_its_odometry(self) -> None:
        estimate = next(iter(locus.replay(ROOM)))
        covariance = estimate.pose_covariance
        self.assertEqual(covariance.shape, (6, 6))
        values = covariance.tolist()
        del estimate
        gc.collect()
        self.assertEqual(covariance.tolist(), values)

    def test_clouds(self) -> None:
        odometry = locus.Odometry(set=["lidars.front.topic=/points", "motion_sources=[]"])
        dice = np.random.default_rng(1)
        walls = dice.uniform(-10, 10, (5000, 3))
        walls[np.arange(5000), dice.integers(0, 3, 5000)] = 10
        estimates = []
        for turn in range(10):
            stamp_ns = NOW_NS + turn * 100_000_000
            time = np.linspace(0, 0.0999, 5000)
            ring = np.arange(5000) % 16
            intensity = np.full(5000, 7)
            # Any sequence of numbers will do, in any order of memory.
            xyz = [walls, np.asfortranarray(walls), walls.tolist(), walls.astype(np.float32)][turn % 4]
            estimates += odometry.cloud("front", xyz, stamp_ns, stamp_ns + 10**8, time, ring, intensity)
        estimates += odometry.finish()
        self.assertGreater(len(estimates), 7)
        self.assertLess(max(abs(estimates[-1].position)), 0.01)

    def test_buffers_of_any_kind(self) -> None:
        odometry = locus.Odometry()
        payloads: list[bytes | bytearray | memoryview | NDArray[np.uint8]]
        payloads = [b"", bytearray(1206), memoryview(bytes(1206)), np.zeros(1206, np.uint8)]
        for payload in payloads:
            self.assertEqual(odometry.packet(payload, NOW_NS, source_ip="192.168.1.201"), [])
        with self.assertRaises((BufferError, ValueError)):
            odometry.packet(np.zeros(2412, np.uint8)[::2], NOW_NS)
        self.assertEqual(json.loads(odometry.figures_json())["packets"]["total"]["received"], 4)

    def test_mistakes_are_reported(self) -> None:
        odometry = locus.Odometry()
        rest, level = [0.0, 0.0, 9.81], [0.0, 0.0, 0.0, 1.0]
        mistakes: list[tuple[Callable[[], object], str]] = [
            (lambda: locus.Odometry("/nowhere.yaml"), "/nowhere.yaml"),
            (lambda: locus.Odometry(set=["lidars.front.prot=1"]), "prot"),
            (lambda: locus.replay("/nowhere"), "/nowhere"),
            (lambda: locus.replay(ROOM, start=math.nan), "start"),
            (lambda: locus.replay(ROOM, duration=-1), "duration"),
            (lambda: odometry.imu("wio", NOW_NS, rest, rest), "odometry()"),
            (lambda: odometry.imu("imu", NOW_NS, [0.0], rest), "3 numbers"),
            (lambda: odometry.imu("imu", NOW_NS, rest, rest, [0.0] * 4), "unit quaternion"),
            (lambda: odometry.odometry("wio", NOW_NS, rest, level[:3]), "4 numbers"),
            (lambda: odometry.odometry("wio", 2**63 - 1, rest, level), "1951"),
            (lambda: odometry.packet(b"", NOW_NS, source_ip="lidar"), "lidar"),
            (lambda: odometry.cloud("front", np.zeros((2, 3)), NOW_NS), "receives packets"),
            (lambda: odometry.cloud("front", np.zeros(6), NOW_NS), "(n, 3)"),
        ]
        for call, part in mistakes:
            with self.subTest(part), self.assertRaises(locus.Error) as raised:
                call()
            self.assertIn(part, str(raised.exception))
        for wrong in (-1, 2**63, "now", None):
            with self.subTest(wrong), self.assertRaises((TypeError, locus.Error, OverflowError)):
                odometry.packet(b"", wrong if wrong != -1 else NOW_NS, port=wrong)  # type: ignore[arg-type]
        self.assertEqual(odometry.imu("imu", NOW_NS, [math.nan] * 3, rest), [])
        self.assertEqual(odometry.finish(), [])
        with self.assertRaises(locus.Error):
            odometry.finish()

    def test_everything_is_documented(self) -> None:
        for owner in (locus.Error, locus.Estimate, locus.SourceEstimate, locus.Odometry, locus.Replay):
            self.assertTrue(owner.__doc__, owner)
            self.assertEqual(owner.__module__, "locus")
            for name, member in vars(owner).items():
                if not name.startswith("_"):
                    self.assertTrue(member.__doc__, f"{owner.__name__}.{name}")
        self.assertTrue(locus.replay.__doc__)


unittest.main(argv=sys.argv[:1])
