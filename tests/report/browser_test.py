#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""browser_test.py SAMPLE_REPORTS: tests the reports of this program in headless Chromium.

Stores screenshots in the folder LOCUS_SCREENSHOTS if that is set.
"""
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.path.append(os.path.join(os.path.dirname(__file__), "../support"))
from browser import Browser  # exits if there is no browser
from selenium.webdriver import ActionChains

FIGURES = {"plan", "map", "side", "boxes", "timeline"}
TABLES = {"stages", "input", "sources", "configuration"}

# Contrast ratio of two colours by WCAG 2.
CONTRAST = """
  const [names] = arguments, style = getComputedStyle(document.documentElement);
  const luminance = (name) => {
    const [r, g, b] = style.getPropertyValue("--" + name).trim().match(/[0-9a-f]{2}/g)
        .map((part) => parseInt(part, 16) / 255).map((c) => (c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const [low, high] = names.map(luminance).sort((a, b) => a - b);
  return (high + 0.05) / (low + 0.05);
"""


class Report(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix="locus-report-")
        subprocess.run([sample_reports, cls.folder], check=True)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def browser(self, name, **how):
        return Browser(os.path.join(self.folder, f"{name}.html"), **how)

    def expect_all_drawn(self, browser):
        self.assertEqual(browser.drawn(), FIGURES | TABLES)
        for selector in "#plan .estimate", "#side .estimate", "#plan .truth", "#side .truth":
            self.assertGreater(len(browser.one(f"{selector}[d]").get_attribute("d")), 1000, selector)
        self.assertGreater(browser.canvas("#plan canvas")["painted"], 0.005, "walls in the plan")
        self.assertGreater(browser.canvas("#map canvas")["colours"], 100, "tiles coloured by height")
        self.assertGreater(browser.canvas("#map canvas")["painted"], 0.05, "share of the map's picture")
        series = browser.all("#timeline .series")
        self.assertEqual(len(series), 4)
        for line in series:
            self.assertGreater(len(line.get_attribute("d")), 500)
        self.assertEqual(len(browser.all("#timeline .band")), 4, "state, lidar and two sources")
        self.assertEqual(len(browser.all("#boxes .box-plot")), 6)
        self.assertEqual(len(browser.all("#stages tbody tr")), 9)
        self.assertEqual(len(browser.all("#stages svg.quantiles circle")), 9)
        self.assertEqual(browser.complaints(), [])

    def test_hour_is_drawn_in_full_without_network_requests(self):
        with self.browser("hour") as browser:
            self.expect_all_drawn(browser)
            self.assertEqual(browser.run("return performance.getEntriesByType('resource').length"), 0)
            self.assertEqual(browser.one("#capture").text, "hour")
            self.assertIn("1:00h", browser.one("#key-figures").text.replace("\u202f", "").replace(" ", ""))
            browser.keep_picture("hour")

    def test_fits_a_phone(self):
        with self.browser("hostile", width=360) as browser:
            self.expect_all_drawn(browser)
            self.assertLessEqual(browser.run("return document.documentElement.scrollWidth"), 360)
            for drawing in browser.all(".drawing > svg, .drawing > canvas"):
                self.assertLessEqual(drawing.rect["x"] + drawing.rect["width"], 360)
            outside = browser.run("""
              return [...document.querySelectorAll(".drawing > svg text")].filter((text) => {
                const box = text.getBoundingClientRect();
                return box.width > 0 && (box.left < 0 || box.right > 360);
              }).map((text) => text.textContent)""")
            self.assertEqual(outside, [])
            browser.keep_picture("phone")

    def test_is_readable_in_light_and_dark(self):
        with self.browser("hostile") as browser:
            for dark in False, True:
                browser.set_dark(dark)
                paper = browser.run("return getComputedStyle(document.body).backgroundColor")
                shade = sum(int(part) for part in paper[4:-1].split(",")) / 3
                self.assertTrue(shade < 40 if dark else shade > 230, paper)
                for text in "ink", "muted", "warning":
                    self.assertGreater(browser.run(CONTRAST, [text, "paper"]), 4.5, f"{text}, dark: {dark}")
                self.assertGreater(browser.run(CONTRAST, ["estimate", "paper"]), 3.0)
                self.assertGreater(browser.run(CONTRAST, ["estimate", "truth"]), 2.0)
            browser.keep_picture("dark")

    def test_canvases_follow_the_colour_scheme(self):
        with self.browser("hostile") as browser:
            before = {canvas: browser.canvas(canvas)["sum"] for canvas in ("#plan canvas", "#map canvas")}
            browser.set_dark(True)
            for canvas, light in before.items():
                browser.wait_until(lambda: browser.canvas(canvas)["sum"] != light)
            self.expect_all_drawn(browser)

    def test_figures_follow_the_width_of_the_page(self):
        with self.browser("hostile") as browser:
            browser.set_size(360)
            browser.wait_until(lambda: browser.run(
                "return document.querySelector('#timeline .drawing > svg').viewBox.baseVal.width") < 360)
            self.assertLessEqual(browser.run("return document.documentElement.scrollWidth"), 360)
            self.expect_all_drawn(browser)

    def test_health_is_shown_by_shape_and_colour(self):
        with self.browser("hostile") as browser:
            looks = browser.run("""
              const look = (rect) => [rect.getAttribute("fill").startsWith("url("), rect.getAttribute("height")].join();
              return Object.fromEntries([...document.querySelectorAll("#timeline .band rect")].map(
                  (rect) => [rect.dataset.what, look(rect)]))""")
            self.assertEqual(set(looks),
                             {"tracking", "degenerate", "dead reckoning", "used", "healthy, not used", "lost"})
            self.assertEqual(len({looks["used"], looks["healthy, not used"], looks["lost"]}), 3, looks)
            self.assertNotEqual(looks["tracking"], looks["degenerate"])

    def test_verdict_on_a_source_is_shown_with_its_counts(self):
        with self.browser("hostile") as browser:
            self.assertIn("▲ nan 7, turns the other way", browser.one("#sources").text)

    def test_map_rotates_by_dragging_and_zooms_by_the_wheel(self):
        with self.browser("hostile") as browser:
            canvas = browser.one("#map canvas")
            seen = [browser.canvas("#map canvas")["sum"]]
            ActionChains(browser.driver).drag_and_drop_by_offset(canvas, 120, 30).perform()
            seen.append(browser.canvas("#map canvas")["sum"])
            browser.run("arguments[0].dispatchEvent(new WheelEvent('wheel', {deltaY: -240, cancelable: true}))", canvas)
            seen.append(browser.canvas("#map canvas")["sum"])
            for button in reversed(browser.all("#map button")):
                button.click()
                seen.append(browser.canvas("#map canvas")["sum"])
            self.assertEqual(seen.pop(), seen[0], "oblique again, as at first")
            self.assertEqual(len(set(seen)), 5, "each time another picture")

    def test_selected_instant_is_shown_in_every_figure(self):
        with self.browser("hostile") as browser:
            map_before = browser.canvas("#map canvas")["sum"]
            timeline = browser.one("#timeline .drawing > svg")
            ActionChains(browser.driver).move_to_element(timeline).perform()
            readings = [reading.text for reading in browser.all("#timeline .reading")]
            self.assertEqual(sum(reading != "" for reading in readings), len(readings))
            self.assertTrue(any(reading.endswith("mm") for reading in readings), readings)
            for dot in "#plan .here", "#side .here":
                self.assertTrue(browser.one(dot).is_displayed())
            self.assertNotEqual(browser.canvas("#map canvas")["sum"], map_before)

    def test_names_are_escaped(self):
        with self.browser("hostile") as browser:
            self.assertIsNone(browser.run("return window.broken_out ?? null"))
            self.assertIn("<script>window.broken_out", browser.one("#about").text)
            self.assertIn("</script>", browser.one("#sources").text)
            self.expect_all_drawn(browser)

    def test_without_webgl_a_message_replaces_the_map(self):
        with self.browser("hostile", webgl=False) as browser:
            self.assertIn("WebGL", browser.one("#map .note").text)
            self.assertEqual(browser.drawn(), FIGURES | TABLES)
            self.assertEqual(browser.complaints(), [])

    def test_missing_truth_map_and_sources_are_noted(self):
        with self.browser("bare", width=360) as browser:
            self.assertEqual(browser.drawn(), FIGURES | TABLES)
            self.assertIn("no true trajectory", browser.one("#boxes .note").text)
            self.assertIn("map is empty", browser.one("#map .note").text)
            self.assertEqual(len(browser.all(".truth")), 0)
            self.assertEqual(browser.complaints(), [])
            browser.keep_picture("bare")

    def test_recording_without_a_sweep_has_its_counters(self):
        with self.browser("nothing") as browser:
            self.assertEqual(browser.drawn(), TABLES)
            self.assertIn("There was no sweep", browser.one("#plan .note").text)
            self.assertIn("rejected: length", browser.one("#input").text)
            self.assertIn("VLP-16", browser.one("#input").text)
            self.assertEqual(browser.complaints(), [])

    def test_clouds_have_a_table_in_place_of_packets(self):
        with self.browser("clouds") as browser:
            table = browser.one("#input").text
            for part in "/points", "clouds used 150", "refused: fields ▲ 2":
                self.assertIn(part, table)
            for part in "acket", "model":
                self.assertNotIn(part, table)
            self.assertNotIn("packets", browser.one("#key-figures").text)
            self.assertEqual(browser.complaints(), [])


if __name__ == "__main__":
    sample_reports = sys.argv.pop(1)
    unittest.main(verbosity=2)
