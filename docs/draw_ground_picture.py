#!/usr/bin/env python3
"""Redraws docs/ground-one.png, docs/ground.png and docs/ground-phone.png in headless Chromium.

``.venv/bin/python docs/draw_ground_picture.py``

The first shows one vehicle: the README's daemon and mock, and ``ground`` with its link and its status. The others show
``demo --fleet 3``. It needs Debian's packages chromium and chromium-driver, and the extra ``[test]``, which brings
selenium.
"""

from __future__ import annotations

import io
import re
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory
from typing import Any

from PIL import Image
from selenium import webdriver

FLIGHT_S = 60
FUSED_S = 35
"""Time of the flight at which the pictures of the fleet are taken."""
ALONE_S = 25
"""Time of the flight at which the picture of one vehicle is taken."""
PERSONS = ("3,0", "-3,4", "-1,-5", "7,6")
"""Metres from the flight centre."""
LAPTOP = (1280, 900)
PHONE = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking")
FOLDER = Path(__file__).parent


def main() -> None:
    """Fly twice, and take the pictures."""
    with TemporaryDirectory() as folder, ExitStack() as stack:
        options = webdriver.ChromeOptions()
        options.binary_location = which("chromium") or ""
        for flag in FLAGS:
            options.add_argument(flag)
        browser = webdriver.Chrome(options=options, service=webdriver.ChromeService(which("chromedriver")))
        stack.callback(browser.quit)
        _one_vehicle(Path(folder), lambda address: _picture_of_one(browser, address))
        with _started("fwav_companion", "demo", "--fleet=3", f"--seconds={FLIGHT_S}", f"--out={folder}/fleet") as demo:
            address = _address(demo)
            time.sleep(FUSED_S)
            _pictures_of_three(browser, address)


def _one_vehicle(folder: Path, use: Callable[[str], None]) -> None:
    """The daemon, the mock and ``ground`` as in the README, on ports of their own."""
    autopilot, detections, station, http = (_free_port() for _ in range(4))
    with ExitStack() as stack:
        subprocess.run([sys.executable, "-m", "fwav_companion", "init", str(folder)], check=True)  # noqa: S603
        file = folder / "fwav-companion.toml"
        text = file.read_text(encoding="utf-8").replace(
            "serial:///dev/serial0:921600", f"udpin://127.0.0.1:{autopilot}"
        )
        text = text.replace("127.0.0.1:14601", f"127.0.0.1:{detections}").replace(
            "127.0.0.1:14550", f"127.0.0.1:{station}"
        )
        file.write_text(text.replace('file = ""', 'file = "status.json"'), encoding="utf-8")
        enter = stack.enter_context
        words = [f"--link=udpin://127.0.0.1:{station}", f"--status={folder}/status.json", f"--http=127.0.0.1:{http}"]
        ground = enter(_started("fwav_companion", "ground", *words))
        enter(_started("fwav_companion", "run", f"--config={file}"))
        words = [f"--connect=udpout:127.0.0.1:{autopilot}"]
        words += [f"--detections=127.0.0.1:{detections}", *(f"--target=person,{place}" for place in PERSONS)]
        enter(_started("sitl_mock", *words))
        address = _address(ground)
        time.sleep(ALONE_S)
        use(address)


@contextmanager
def _started(*words: str) -> Iterator[subprocess.Popen[str]]:
    """A program of this package, ended at the end."""
    program = subprocess.Popen([sys.executable, "-m", *words], stdout=subprocess.PIPE, text=True)  # noqa: S603
    try:
        yield program
    finally:
        program.terminate()
        program.wait()


def _address(program: subprocess.Popen[str]) -> str:
    found = re.search(r"http://\S+", program.stdout.readline() if program.stdout else "")
    if found is None:
        sys.exit("no address was printed")
    return found.group()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _picture_of_one(browser: Any, address: str) -> None:
    browser.set_window_size(*LAPTOP)
    browser.get(address)
    time.sleep(4.0)
    browser.find_element("id", "tab-vehicles").click()
    time.sleep(2.0)
    _save(browser.get_screenshot_as_png(), FOLDER / "ground-one.png")


def _pictures_of_three(browser: Any, address: str) -> None:
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


def _save(data: bytes, path: Path) -> None:
    """In full colour: a palette loses the colours of thin lines."""
    Image.open(io.BytesIO(data)).convert("RGB").save(path, optimize=True)


if __name__ == "__main__":
    main()
