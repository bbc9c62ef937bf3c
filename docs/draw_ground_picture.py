#!/usr/bin/env python3
"""Redraws docs/ground.png and docs/ground-phone.png: the ground picture of ``demo --fleet 3``, in headless Chromium.

``.venv/bin/python docs/draw_ground_picture.py``

It needs Debian's packages chromium and chromium-driver, and the extra ``[test]``, which brings selenium.
"""

from __future__ import annotations

import io
import re
import subprocess
import sys
import time
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory

from PIL import Image
from selenium import webdriver

FLIGHT_S = 60
FUSED_S = 35
"""Time of the flight at which the pictures are taken."""
LAPTOP = (1280, 760)
PHONE = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking")
FOLDER = Path(__file__).parent


def main() -> None:
    """Fly, and take both pictures."""
    with TemporaryDirectory() as folder:
        words = [sys.executable, "-m", "fwav_companion", "demo", "--fleet", "3", f"--seconds={FLIGHT_S}"]
        flight = subprocess.Popen([*words, f"--out={folder}"], stdout=subprocess.PIPE, text=True)  # noqa: S603
        try:
            found = re.search(r"http://\S+", flight.stdout.readline() if flight.stdout else "")
            if found is None:
                sys.exit("the demonstration printed no address")
            time.sleep(FUSED_S)
            _take_pictures(found.group())
        finally:
            flight.terminate()
            flight.wait()


def _take_pictures(address: str) -> None:
    options = webdriver.ChromeOptions()
    options.binary_location = which("chromium") or ""
    for flag in FLAGS:
        options.add_argument(flag)
    browser = webdriver.Chrome(options=options, service=webdriver.ChromeService(which("chromedriver")))
    try:
        browser.set_window_size(*LAPTOP)
        browser.get(address)
        time.sleep(4.0)
        browser.find_element("css selector", "#targets .row").click()
        time.sleep(3.0)
        _save(browser.get_screenshot_as_png(), FOLDER / "ground.png")
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", PHONE)
        browser.find_element("id", "theme").click()
        browser.find_element("css selector", "#details h2 button").click()
        time.sleep(1.0)
        browser.find_element("id", "fit").click()
        time.sleep(2.0)
        _save(browser.get_screenshot_as_png(), FOLDER / "ground-phone.png")
    finally:
        browser.quit()


def _save(data: bytes, path: Path) -> None:
    """256 colours keep the file small."""
    Image.open(io.BytesIO(data)).convert("RGB").quantize(256).save(path, optimize=True)


if __name__ == "__main__":
    main()
