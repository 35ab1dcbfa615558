#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""library_instructions.py BIN DRIVE: the library executes at most 5 % more instructions than locus-replay.

A replay of the capture folder DRIVE, and its packets fed one by one beside a replay of its capture alone. Counted by callgrind
in one thread: unlike times, the counts depend on the inputs alone. Those of the program include its result files.
"""
import re
import subprocess
import sys
import tempfile
from pathlib import Path

MOST = 1.05


def instructions(folder: str, *command: str | Path) -> int:
    """Returns the number of instructions of a program."""
    counts = Path(folder, "counts")
    subprocess.run(
        ["valgrind", "--tool=callgrind", f"--callgrind-out-file={counts}", *command], check=True, capture_output=True
    )
    found = re.search(r"^(?:totals|summary): (\d+)", counts.read_text(), re.MULTILINE)
    assert found, counts.read_text()[-200:]
    return int(found[1])


def main() -> int:
    bin_folder, drive = Path(sys.argv[1]), Path(sys.argv[2])
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        program = (bin_folder / "locus-replay", "--quiet", "--set", "threads=1", "-o", Path(folder, "results"))
        library = bin_folder / "library_run"
        for name, by_program, by_library in (
            ("replay", (drive,), ("replay", drive)),
            ("packets", ("--set", "motion_sources=[]", drive / "lidar.pcap"), ("packets", drive / "lidar.pcap")),
        ):
            alone = instructions(folder, *program, *by_program)
            fed = instructions(folder, library, *by_library)
            worst = max(worst, fed / alone)
            print(f"{name}: locus-replay {alone / 1e6:.0f}, library {fed / 1e6:.0f} million instructions: {fed / alone:.3f}")
    return 0 if worst <= MOST else 1


sys.exit(main())
