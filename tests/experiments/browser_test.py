#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""browser_test.py SAMPLE_PAGE: tests the page of this program in headless Chromium.

Stores screenshots in the folder LOCUS_SCREENSHOTS if that is set.
"""
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.path.append(os.path.join(os.path.dirname(__file__), "../support"))
from browser import Browser  # exits if there is no browser

PARTS = {"accuracy", "boxes", "robustness", "ablation", "ablation-table", "pace"}
FAILURES = ["wio_imu_fail", "wio_fail", "lidar_drop"]
ACCURACY = ["locusd", "locusd_fga", "paper", "paper_fga"]
ABLATION = ["imu_int", "no_int", "loam_feat", "rdf_off", "vgf_off", "mdc_off"]
PACE = ["pace_1cpu", "pace_2cpu"]


def run(course, configuration, mean_m=0.01):
    quantiles = {"p50": 1.5, "p90": 2.5, "p99": 3.5, "max": 4.5}
    box = {"p1": 0.1 * mean_m, "q1": 0.7 * mean_m, "median": mean_m, "q3": 1.4 * mean_m, "p99": 3 * mean_m,
           "max": 4 * mean_m}
    errors = [mean_m * (1.1 + math.sin(0.1 * i)) for i in range(300)]
    return {"course": course, "configuration": configuration, "machine": "a processor", "silent_at_end_s": 0,
            "summary": {"ape_m": {"max": 4 * mean_m, "mean": mean_m, "std": mean_m, "rmse": mean_m},
                        "rpe_10m_percent": 0.1, "map_error_m": {"rmse": 0.02, "outliers": 3},
                        "process_ms": quantiles, "process_cpu_ms": quantiles, "points": {"filtered_mean": 2000},
                        "sweeps": {"dropped": 30}, "duration_s": 60, "cpu_s": 12},
            "position_error": {"t_s": list(range(300)), "error_m": errors}, "position_error_quantiles_m": box}


def paper_runs():
    runs = [run(course, name) for course in ("alpha", "beta") for name in ACCURACY + FAILURES + PACE]
    runs += [run("alpha", name, 0.01 * 2**i) for i, name in enumerate(ABLATION)]
    return runs + [run(course, name) for course in ("spot_alpha", "spot_beta") for name in PACE]


class Page(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="locus-experiments-")
        self.addCleanup(shutil.rmtree, self.folder)

    def page(self, runs, simulated=True, **how):
        """Opens the page of these runs."""
        with open(os.path.join(self.folder, "results.json"), "w", encoding="utf-8") as file:
            json.dump({"version": "1.2.3", "simulated": simulated, "duration_s": 300, "runs": runs}, file)
        subprocess.run([program, self.folder], check=True)
        return Browser(os.path.join(self.folder, "experiments.html"), **how)

    def rows(self, browser, part):
        return [row.text for row in browser.all(f"#{part} tbody tr")]

    def expect_whole(self, browser):
        self.assertEqual(browser.drawn(), PARTS)
        self.assertEqual(len(browser.all("#boxes .box-plot")), 8)
        lines = browser.all("#ablation path.variant")
        self.assertEqual(len(lines), 8)
        for line in lines:
            self.assertGreater(len(line.get_attribute("d")), 1000)
        self.assertEqual(browser.complaints(), [])

    def test_every_part_is_drawn_with_our_figures_and_the_papers(self):
        with self.page(paper_runs()) as browser:
            self.expect_whole(browser)
            self.assertIn("These courses are simulated", browser.one("#simulated").text)
            self.assertIn("5:00 min", browser.one("#simulated").text)
            self.assertFalse(browser.one("#recorded").is_displayed())
            self.assertFalse(browser.one("#failed").is_displayed())
            accuracy = self.rows(browser, "accuracy")
            self.assertIn("paper: LOCUS 1.69 0.620 0.570 0.290 –", accuracy)
            self.assertIn("locusd with default settings 0.0400 0.0100 0.0100 0.0200 0.100", accuracy)
            self.assertIn("on one core 1.50 2.50 3.50 4.50 0.500 0.200", self.rows(browser, "pace"))
            self.assertIn("locusd, Beta 0.0400 m" + 3 * " OK, 0.0400 m",
                          self.rows(browser, "robustness"))
            browser.keep_picture("experiments")

    def test_fits_a_phone_in_dark_mode(self):
        with self.page(paper_runs(), width=360, dark=True) as browser:
            self.expect_whole(browser)
            self.assertLessEqual(browser.run("return document.documentElement.scrollWidth"), 360)
            browser.set_size(800)
            chart = browser.one("#ablation figcaption")
            browser.wait_until(lambda: chart.size["width"] > 600)
            self.expect_whole(browser)
            browser.set_size(360)
            browser.keep_picture("experiments-phone")

    def test_missing_runs_are_noted(self):
        with self.page([run("alpha", "paper_fga"), run("alpha", "mdc_off"), run("beta", "pace_1cpu")]) as browser:
            self.assertEqual(browser.drawn(), PARTS - {"robustness"})
            self.assertFalse(browser.one("#robustness").is_displayed())
            ablation = self.rows(browser, "ablation-table")
            self.assertIn("loam_feat not run LOAM's edge and plane points instead of the filters", ablation)
            self.assertIn("on two cores not run", self.rows(browser, "pace"))
            self.assertEqual(browser.complaints(), [])

    def test_failed_runs_are_named_and_names_are_escaped(self):
        hostile = "</script><script>window.broken_out = 1</script>"
        runs = [run(hostile, "locusd"), {"course": hostile, "configuration": "paper", "failed": hostile}]
        with self.page(runs, simulated=False) as browser:
            self.assertIsNone(browser.run("return window.broken_out ?? null"))
            self.assertEqual(browser.drawn(), {"accuracy", "boxes"})
            self.assertIn(f"paper: {hostile}", browser.one("#failures").text)
            self.assertFalse(browser.one("#simulated").is_displayed())
            self.assertEqual(browser.complaints(), [])


if __name__ == "__main__":
    program = sys.argv.pop(1)
    unittest.main(verbosity=2)
