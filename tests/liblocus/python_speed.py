# SPDX-License-Identifier: Apache-2.0
"""python_speed.py BIN: a replay by the package locus takes at most 5 % more CPU time than one by locus-replay.

Medians over consecutive pairs of runs, because other load of the machine varies. The times include the program's writing of
its files and the package's import of NumPy, which takes 0.2 s: the drive is long enough.
"""
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

PAIRS = 5
MOST = 1.05
SCRIPT = "import locus, sys\nfor estimate in locus.replay(sys.argv[1]): estimate.position, estimate.pose_covariance"


def cpu_s(*command: str | Path) -> float:
    """Returns the user and system time of a program."""
    before = os.times()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def main() -> int:
    bin_folder = Path(sys.argv[1])
    with tempfile.TemporaryDirectory() as folder:
        drive, results = Path(folder, "drive"), Path(folder, "results")
        simulate: list[str | Path] = [bin_folder / "locus-sim", "--world", "urban", "--robot", "husky", "--duration", "300", "--seed", "3"]
        cpu_s(*simulate, "-o", drive)
        for truth in ("gt.tum", "gt_map.ply"):  # only the program would read them
            (drive / truth).unlink()
        pairs = []
        for _ in range(PAIRS):
            program = cpu_s(bin_folder / "locus-replay", "--quiet", "-o", results, drive)
            library = cpu_s(sys.executable, "-c", SCRIPT, drive)
            pairs.append((program, library))
    ratio = statistics.median(library / program for program, library in pairs)
    program, library = (statistics.median(times) for times in zip(*pairs))
    print(f"locus-replay {program:.2f} s, Python {library:.2f} s of CPU; the median ratio is {ratio:.3f}")
    return 0 if ratio <= MOST else 1


sys.exit(main())
