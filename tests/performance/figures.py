# SPDX-License-Identifier: Apache-2.0
"""Results of measure.py by name: medians of the benchmarks, drives, machine."""

UNITS_MS = {"ns": 1e-6, "us": 1e-3, "ms": 1.0, "s": 1e3}
CAPTURES = {
    "plant": "plant, outdoors, VLP-16 at 10 Hz, 1 m/s",
    "mine": "mine, VLP-16 at 10 Hz, 1 m/s",
    "halls": "halls, VLP-16 at 10 Hz, 1 m/s",
    "hdl32e_moving_15mps": "real: HDL-32E at 12 Hz, car at 15 m/s, six sweeps with the start in motion",
    "hdl32e_static_monterey": "real: HDL-32E at 12 Hz, car at standstill, pulling away",
    "vlp16_static_1200rpm_product21": "real: VLP-16 at 20 Hz, at standstill",
}


class Figures:
    def __init__(self, measured):
        self.machine = measured["machine"]
        self.context = measured["benchmarks"]["context"]
        self.drives = measured["drives"]
        self.long_drive = measured["long_drive"]
        self.runs = {}
        for run in measured["benchmarks"]["benchmarks"]:
            name = run["run_name"].split("/iterations:")[0]
            if run.get("error_occurred"):
                raise SystemExit(f"page.py: {name}: {run['error_message']}")
            if run["run_type"] == "iteration" or run["aggregate_name"] == "median":
                self.runs[name] = run

    def has(self, name):
        return name in self.runs

    def cpu_ms(self, name):
        return self._time_ms(name, "cpu_time")

    def wall_ms(self, name):
        return self._time_ms(name, "real_time")

    def counter(self, name, counter):
        return self.runs[name][counter]

    def _time_ms(self, name, which):
        return self.runs[name][which] * UNITS_MS[self.runs[name]["time_unit"]]

    def named(self, first):
        """Returns the names that begin with `first`, without it, in numerical order."""
        rests = [name.removeprefix(first + "/").split("/") for name in self.runs if name.startswith(first + "/")]
        return sorted(rests, key=lambda rest: [(int(word), "") if word.isdigit() else (0, word) for word in rest])

    def captures(self):
        return [name for name in CAPTURES if self.has(f"pipeline/{name}/lidar")]

    def line(self, first, key, figure):
        """Returns (x, y) of each benchmark first/X/...; `key` extracts X from the rest of its name, None to skip it."""
        line = []
        for rest in self.named(first):
            x = key(rest)
            if x is not None:
                line.append((x, figure("/".join([first, *rest]))))
        return sorted(line)
