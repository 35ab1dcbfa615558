# SPDX-License-Identifier: Apache-2.0
"""Drives headless Chromium. Exits as skipped if Chromium or python3-selenium is missing."""
import os
import shutil
import sys
import tempfile

try:
    from selenium import webdriver
    from selenium.webdriver.common.by import By
    from selenium.webdriver.support.wait import WebDriverWait
except ImportError as error:
    print(f"SKIPPED: {error}; install python3-selenium", file=sys.stderr)
    sys.exit(77)

CHROMIUM, DRIVER = "/usr/bin/chromium", "/usr/bin/chromedriver"
for program, package in (CHROMIUM, "chromium"), (DRIVER, "chromium-driver"):
    if not os.access(program, os.X_OK):
        print(f"SKIPPED: {program} is not there; install {package}", file=sys.stderr)
        sys.exit(77)

# Number of colours in a canvas and the fraction of it that is painted.
LOOK_AT_CANVAS = """
  const source = document.querySelector(arguments[0]), copy = document.createElement("canvas");
  copy.width = source.width; copy.height = source.height;
  const context = copy.getContext("2d");
  context.drawImage(source, 0, 0);
  const pixels = new Uint32Array(context.getImageData(0, 0, copy.width, copy.height).data.buffer);
  let sum = 0;
  for (const pixel of pixels) sum = (31 * sum + pixel) | 0;
  return {colours: new Set(pixels).size, painted: pixels.filter((pixel) => pixel !== 0).length / pixels.length, sum};
"""


class Browser:
    """A page, given by its path or address, in its own window, closed at the end of a with statement."""

    def __init__(self, page, width=1280, dark=False, webgl=True):
        self.profile = tempfile.mkdtemp(prefix="locus-browser-")
        options = webdriver.ChromeOptions()
        options.binary_location = CHROMIUM
        graphics = (["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"] if webgl
                    else ["--disable-gpu", "--disable-3d-apis"])
        for argument in ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--disable-quic",
                         "--no-first-run",
                         "--disable-background-networking", "--disable-component-update", "--disable-sync",
                         f"--user-data-dir={self.profile}", *graphics]:
            options.add_argument(argument)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        self.driver = webdriver.Chrome(service=webdriver.chrome.service.Service(DRIVER), options=options)
        self.driver.set_script_timeout(120)  # software rendering of the first page is slow on a busy processor
        self.set_size(width)
        self.set_dark(dark)
        self.driver.get(page if "://" in page else f"file://{page}")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.driver.quit()
        shutil.rmtree(self.profile, ignore_errors=True)

    def set_size(self, width, height=900):
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                                    {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600})

    def set_dark(self, dark):
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})

    def run(self, script, *arguments):
        return self.driver.execute_script(script, *arguments)

    def one(self, selector):
        return self.driver.find_element(By.CSS_SELECTOR, selector)

    def all(self, selector):
        return self.driver.find_elements(By.CSS_SELECTOR, selector)

    def drawn(self):
        return {part.get_attribute("id") for part in self.all("[data-drawn]")}

    def canvas(self, selector):
        """Finds and inspects the canvas in one script, because the page may replace it at any time."""
        return self.run(LOOK_AT_CANVAS, selector)

    def complaints(self):
        return [entry["message"] for entry in self.driver.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]

    def wait_until(self, condition):
        WebDriverWait(self.driver, 60).until(lambda _: condition())

    def keep_picture(self, name):
        if folder := os.environ.get("LOCUS_SCREENSHOTS"):
            self.set_size(*self.run("return [innerWidth, document.documentElement.scrollHeight]"))
            self.driver.save_screenshot(os.path.join(folder, f"{name}.png"))
