#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""commands.py BIN: runs the commands of the `sh` blocks in README.md and docs/, or checks why they are not run.

The line before a block is a comment:

    <!-- run -->                    each command must succeed, in the order of the page, in one folder for the page
    <!-- run except WORD, ...: REASON -->     the same, without the commands that contain one of the words
    <!-- run by FILE: REMARK -->    FILE, a test, runs the same
    <!-- not run: REASON -->

A folder has the recordings that fixtures() lists. Commands find the programs of BIN; whatever the page writes goes to
the folder. Without locus-sim and locus-replay in BIN, nothing is run.
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(sys.argv[1]).resolve()
BLOCK = re.compile(r"^(?:<!-- (?P<mark>[^\n]*) -->\n)?```sh\n(?P<commands>.*?)^```", re.DOTALL | re.MULTILINE)
MARK = re.compile(r"(?P<kind>run by|run except|run|not run)(?: (?P<what>[^:]+))?(?:: (?P<why>.+))?")


def commands_of(block):
    """Returns the commands of a block, with those that continue on the next line as one."""
    lines = re.sub(r"\\\n", " ", block).splitlines()
    return [line for line in lines if line.strip() and not line.lstrip().startswith("#")]


def run(command, folder):
    """Returns the error of a command, in a shell of its own; empty if it succeeded."""
    environment = {**os.environ, "PATH": f"{BIN}:{os.environ['PATH']}"}
    done = subprocess.run(["bash", "-euo", "pipefail", "-c", command], cwd=folder, env=environment, text=True,
                          stdin=subprocess.DEVNULL, capture_output=True, check=False)
    return "" if done.returncode == 0 else f"status {done.returncode}: {done.stderr.strip()}"


def fixtures(folder):
    """Writes the recordings that the pages name: 6 s of a simulated drive as a capture, and as bags."""
    drive = folder / "robot_folder"
    for command in [
            "locus-sim --world urban --robot husky --duration 6 --realism clean --seed 1 -o robot_folder",
            "cp robot_folder/lidar.pcap drive.pcap; cp robot_folder/imu.csv imu.csv; cp robot_folder/wio.tum wheels.tum",
            "cp robot_folder/gt.tum gt.tum; cp robot_folder/gt_map.ply gt_map.ply 2>/dev/null || true",
            "locus-replay --quiet --sweeps sweeps -o out robot_folder",
            "cp robot_folder/imu.csv robot_folder/wio.tum sweeps/; rm -r out",
            # clouds, IMU and wheels on the topics that the pages name
            "locus-replay --quiet --set lidars.0.topic=/velodyne_points --set lidars.0.point_times=none "
            "--imu imu.csv --odometry wio=wheels.tum --mcap drive.mcap -o out sweeps",
            "locus-replay --quiet --set lidars.0.topic=/points --set lidars.0.point_times=none "
            "--set motion_sources.imu.topic=/imu --set motion_sources.wio.topic=/odom "
            "--imu imu.csv --odometry wio=wheels.tum --mcap drive_ros2.mcap -o out sweeps",
            "mkdir drive_ros2; mv drive_ros2.mcap drive_ros2/drive_0.mcap; rm -r out sweeps",
            "printf 'rosbag2_bagfile_information:\\n  storage_identifier: mcap\\n  relative_file_paths: [drive_0.mcap]\\n' "
            ">drive_ros2/metadata.yaml",
            "locus-sim --world urban --robot husky --model OS1-32 --duration 3 --realism clean -o ouster",
            "mv ouster/lidar.pcap ouster.pcap; mv ouster/top.json ouster.json; rm -r ouster",
    ]:
        if error := run(command, folder):
            raise SystemExit(f"a recording for the pages could not be made: {command}: {error}")
    shutil.copytree(ROOT / "config", folder / "config")
    shutil.copytree(drive, folder / "recordings" / "robot1")


def check(page, folder, can_run):
    """Returns the problems of a page."""
    for block in BLOCK.finditer(page.read_text()):
        line = page.read_text().count("\n", 0, block.start("commands"))
        where = f"{page.relative_to(ROOT)}:{line}"
        mark = MARK.fullmatch(block["mark"] or "")
        if not mark:
            yield f"{where}: no comment before it says whether these commands are run (commands.py)"
            continue
        kind, what, why = mark["kind"], mark["what"], mark["why"]
        if kind != "run" and not why:
            yield f"{where}: its comment gives no reason"
        if kind == "run by" and not (ROOT / what).exists():
            yield f"{where}: {what} does not exist"
        if not can_run or kind in ("run by", "not run"):
            continue
        left_out = [word.strip() for word in what.split(",")] if kind == "run except" else []
        commands = commands_of(block["commands"])
        for word in left_out:
            if not any(word in command for command in commands):
                yield f"{where}: leaves out {word}, which is in none of its commands"
        for command in commands:
            if not any(word in command for word in left_out):
                if error := run(command, folder):
                    yield f"{where}: {command.strip()}: {error}"


def main():
    can_run = all((BIN / program).exists() for program in ("locus-sim", "locus-replay"))
    problems = []
    with tempfile.TemporaryDirectory() as root:
        original = Path(root) / "fixtures"
        original.mkdir()
        if can_run:
            fixtures(original)
        for page in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]:
            folder = Path(root) / page.stem
            shutil.copytree(original, folder)
            problems += check(page, folder, can_run)
            shutil.rmtree(folder)
    print(*problems, sep="\n")
    sys.exit(1 if problems else 0)


main()
