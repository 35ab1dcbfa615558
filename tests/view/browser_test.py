#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""browser_test.py PROGRAMS DRIVE: tests the page of locusctl view, during a drive, in headless Chromium.

PROGRAMS is the folder of locusd, locusctl, locus-play and locus-sim; DRIVE has the configuration. Stores screenshots
in the folder LOCUS_SCREENSHOTS if that is set.
"""
import ctypes
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest

sys.path.append(os.path.join(os.path.dirname(__file__), "../support"))
from browser import Browser  # exits if there is no browser

CLONE_NEWNET, PORT = 0x40000000, 8042
PAGE = f"http://127.0.0.1:{PORT}/"


def enter_network_of_its_own():
    """Ports and DDS domains are shared with nobody."""
    if ctypes.CDLL(None).unshare(CLONE_NEWNET) != 0:
        print("SKIPPED: no network namespace of one's own: run as root", file=sys.stderr)
        sys.exit(77)
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)


class View(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp(dir="/dev/shm", prefix="locus-view-")
        self.addCleanup(shutil.rmtree, self.folder)

    def start(self, program, *arguments, stdin=subprocess.DEVNULL):
        """Starts a program that ends with the test."""
        environment = dict(os.environ, RUNTIME_DIRECTORY=self.folder, STATE_DIRECTORY=self.folder)
        child = subprocess.Popen([os.path.join(programs, program), *arguments], env=environment, stdin=stdin,
                                 stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.addCleanup(child.wait)
        self.addCleanup(child.stdout.close)
        self.addCleanup(child.kill)
        return child

    def start_service(self):
        return self.start("locusd", "--config", os.path.join(drive, "config.yaml"))

    def start_drive(self):
        """Drives for ten minutes: where a processor draws the map, the first picture may take a minute."""
        robot = self.start("locus-sim", "--world", "urban", "--robot", "husky", "--duration", "600", "--seed", "1",
                           "--realism", "clean", "-o", "-")
        self.start("locus-play", "--quiet", "-", stdin=robot.stdout)

    def start_view(self):
        view = self.start("locusctl", "--socket", os.path.join(self.folder, "control"), "view", "--port", str(PORT))
        self.assertEqual(view.stdout.readline().strip(), PAGE)
        return view

    @staticmethod
    def text(browser, selector):
        return browser.run("return document.querySelector(arguments[0])?.textContent ?? ''", selector)

    def shows(self, browser, selector, part):
        browser.wait_until(lambda: part in self.text(browser, selector))

    def number(self, browser, selector):
        """Returns the first number of a text."""
        digits = self.text(browser, selector).replace("\u202f", "").replace("−", "-").split()
        return float(digits[0]) if digits else 0.0

    def figure(self, browser, name):
        return browser.run("""
          const item = [...document.querySelectorAll("#key-figures div")]
              .find((item) => item.querySelector("dt").textContent === arguments[0]);
          return item?.querySelector(".value").textContent ?? "" """, name).replace("\u202f", "")

    def keep_picture(self, browser, view, name):
        """Holds the page meanwhile: a computer without graphics is busy with drawing, and a picture times out."""
        view.send_signal(signal.SIGSTOP)
        browser.keep_picture(name)
        view.send_signal(signal.SIGCONT)

    def test_drive_is_shown_live_in_every_browser(self):
        service, view = self.start_service(), self.start_view()
        with Browser(PAGE, width=1100) as browser:
            self.shows(browser, "#state", "waiting")
            self.shows(browser, "#sources", "imu")
            self.start_drive()
            self.shows(browser, "#state", "tracking")
            browser.wait_until(lambda: self.number(browser, "#bounds") > 10000)
            browser.wait_until(lambda: float(self.figure(browser, "Path").split()[0] or 0) > 5)
            browser.wait_until(lambda: float(self.figure(browser, "Position, m").split()[0]) > 4)
            self.assertGreater(float(self.figure(browser, "Sweeps per second")), 0)
            self.assertIn("not shown here", self.text(browser, "#key-figures"))
            self.assertIn("VLP-16", self.text(browser, "#lidars"))
            for source in "wio", "imu":
                self.assertIn(source, self.text(browser, "#sources"))
            self.assertIn("of at most 150000 tiles", self.text(browser, "#bounds").replace("\u202f", ""))
            self.assertGreater(float(browser.run(
                "return document.querySelector('#ellipse ellipse').getAttribute('rx')")), 0)
            self.assertGreater(browser.canvas("#map canvas")["painted"], 0.01)
            self.assertGreater(browser.canvas("#map canvas")["colours"], 50)
            sequence = int(browser.run("return document.body.dataset.sequence"))
            browser.wait_until(lambda: int(browser.run("return document.body.dataset.sequence")) > sequence)
            self.keep_picture(browser, view, "view")
            tiles = self.number(browser, "#bounds")
            with Browser(PAGE, width=500, dark=True) as late:  # receives what there is so far
                late.wait_until(lambda: self.number(late, "#bounds") >= tiles)
                self.assertLessEqual(late.run("return document.documentElement.scrollWidth"), 500)
                self.keep_picture(late, view, "view_phone")
                self.assertEqual(late.complaints(), [])
            self.assertEqual(browser.run(
                "return performance.getEntriesByType('resource').filter(({name}) => !name.startsWith(origin)).length"), 0)
            self.assertEqual(browser.complaints(), [])

    def test_page_waits_for_the_service_and_reconnects(self):
        self.start_view()
        with Browser(PAGE, width=500) as browser:
            for _ in range(2):
                self.shows(browser, "#problem", "no service answers")
                self.assertEqual(self.text(browser, "#state"), "not connected")
                service = self.start_service()
                self.shows(browser, "#state", "waiting")
                self.assertEqual(self.text(browser, "#problem"), "")
                service.kill()
            self.shows(browser, "#state", "not connected")

    def test_page_reconnects_to_the_command(self):
        self.start_service()
        view = self.start_view()
        with Browser(PAGE, width=500) as browser:
            self.shows(browser, "#state", "waiting")
            view.send_signal(signal.SIGINT)
            self.assertEqual(view.wait(), -signal.SIGINT)
            self.shows(browser, "#problem", "locusctl view does not answer")
            self.start_view()
            self.shows(browser, "#state", "waiting")

    def test_without_webgl_the_figures_remain(self):
        self.start_service()
        self.start_view()
        with Browser(PAGE, width=500, webgl=False) as browser:
            self.shows(browser, "#state", "waiting")
            self.assertIn("WebGL", self.text(browser, "#map .note"))
            self.assertEqual(browser.complaints(), [])

    def test_port_in_use_is_reported(self):
        self.start_view()
        second = subprocess.run([os.path.join(programs, "locusctl"), "view", "--port", str(PORT)], text=True,
                                capture_output=True, check=False)
        self.assertEqual(second.returncode, 1)
        self.assertIn("127.0.0.1:8042: Address already in use; choose another port with --port N", second.stderr)


if __name__ == "__main__":
    programs, drive = sys.argv[1:3]
    del sys.argv[1:3]
    enter_network_of_its_own()
    unittest.main(verbosity=2)
