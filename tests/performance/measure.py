#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""measure.py BIN [--smoke] [--docs FOLDER]: runs all that docs/performance.md speaks of with the programs in BIN, keeps
the figures as performance.json beside BIN, and writes the page and its pictures anew. The text between the figures stays.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.dont_write_bytecode = True  # writes only the page beside the sources
import page

WORLDS = ["urban", "tunnel", "field", "stairs", "corridor"]


class Machine:
    """Description of the machine for the page, and its other load during the run."""

    def __init__(self):
        self.load = os.getloadavg()[0]
        self.began = time.monotonic()
        self.busy_s = self._busy_s()

    @staticmethod
    def _busy_s():
        fields = [int(n) for n in Path("/proc/stat").read_text().splitlines()[0].split()[1:9]]
        user, nice, system, _idle, _iowait, irq, softirq, _steal = fields
        return (user + nice + system + irq + softirq) / os.sysconf("SC_CLK_TCK")

    def figures(self):
        took_s = time.monotonic() - self.began
        ours = resource.getrusage(resource.RUSAGE_CHILDREN)
        others_s = self._busy_s() - self.busy_s - ours.ru_utime - ours.ru_stime
        model = next(line for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("model name"))
        return {"cpu": " ".join(model.split(":")[1].split()), "cpus": os.cpu_count(), "load_before": self.load,
                "others_cpus": max(0.0, others_s / took_s), "took_s": took_s}


def run(*command, **more):
    try:
        return subprocess.run([str(word) for word in command], check=True, stdout=subprocess.PIPE, text=True, **more).stdout
    except (OSError, subprocess.CalledProcessError) as error:
        sys.exit(f"measure.py: {command[0]}: {error}")


def cpu_s(*command):
    """Runs a command; returns its CPU time, including its children."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run(*command)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def drive(binaries, folder, world, lidars, seconds):
    """Simulates and replays one drive."""
    capture, out = folder / "capture", folder / "out"
    simulating_s = cpu_s(binaries / "locus-sim", "--world", world, "--robot", "husky", "--duration", seconds, "--seed", 1,
                         "--lidars", lidars, "--realism", "clean", "-o", capture)
    run(binaries / "locus-replay", "--threads", 1, "--quiet", "-o", out, capture)
    return {"world": world, "lidars": lidars, "seconds": seconds, "simulating_s": simulating_s,
            "summary": json.loads((out / "summary.json").read_text())}


def drives(binaries, seconds):
    found = []
    for world, lidars in [(world, 1) for world in WORLDS] + [("urban", 2), ("urban", 3)]:
        with tempfile.TemporaryDirectory(prefix="locus-performance-") as folder:
            found.append(drive(binaries, Path(folder), world, lidars, seconds))
    return found


def benchmarks(binaries, smoke):
    with tempfile.NamedTemporaryFile(suffix=".json") as file:
        options = [f"--benchmark_out={file.name}", "--benchmark_out_format=json"] + (["--smoke"] if smoke else [])
        print(run(binaries / "locus_benchmark", *options))
        return json.loads(Path(file.name).read_text())


def measure(binaries, smoke):
    machine = Machine()
    figures = {"drives": drives(binaries, 2 if smoke else 60), "benchmarks": benchmarks(binaries, smoke),
               "long_drive": json.loads(run(binaries / "long_drive", 12 if smoke else 3600))}
    return {"machine": machine.figures(), **figures}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("binaries", metavar="BIN", type=Path, help="bin/ of the build folder")
    parser.add_argument("--smoke", action="store_true", help="a glance at everything; its figures mean nothing")
    parser.add_argument("--docs", type=Path, default=page.DOCS, help="where the page goes; default: docs/")
    arguments = parser.parse_args()
    figures = measure(arguments.binaries, arguments.smoke)
    file = arguments.binaries.parent / ("performance-smoke.json" if arguments.smoke else "performance.json")
    file.write_text(json.dumps(figures, indent=1))
    page.write(figures, arguments.docs)


if __name__ == "__main__":
    main()
