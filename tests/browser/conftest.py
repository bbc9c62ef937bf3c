"""A real browser for the page. Chromium and its driver are Debian's packages; selenium is in the extra `test`."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from processes import Process, free_port

MISSING = "no browser: apt-get install chromium chromium-driver, and pip install selenium"
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--window-size=1280,800",
)  # fmt: skip
WITHIN_S = 60.0
"""Limit of every wait: a hang, not slowness."""


def start_browser() -> Any:
    """A headless Chromium; skips without one. CI sets BROWSER=required: the absence then fails."""
    browser, driver = shutil.which("chromium"), shutil.which("chromedriver")
    try:
        from selenium import webdriver
    except ImportError:
        browser = None
    if browser is None or driver is None:
        if os.environ.get("BROWSER") == "required":
            pytest.fail(MISSING)
        pytest.skip(MISSING)
    options = webdriver.ChromeOptions()
    options.binary_location = browser
    for flag in FLAGS:
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """One browser for all tests."""
    driver = start_browser()
    yield driver
    driver.quit()


class OpenPage:
    """The page of a ground process, and questions to it."""

    def __init__(self, browser: Any, folder: Any) -> None:
        self.browser, self._folder = browser, folder
        self.http, self.mavlink = free_port(), free_port()
        self.url = f"http://127.0.0.1:{self.http}/"
        self.process: Process | None = None

    def start(self, *more: str) -> None:
        """Start the ground process, and wait until it serves."""
        words = ["fwav_companion", "ground", "--http", f"127.0.0.1:{self.http}", "--rate", "10", *more]
        if not more:
            words += ["--link", f"udpin://127.0.0.1:{self.mavlink}"]
        self.process = Process(*words, folder=self._folder)
        self.process.wait_for("ground picture: http")

    def stop(self) -> None:
        """End the ground process."""
        assert self.process is not None
        self.process.kill()

    def open(self) -> None:
        """Load the page."""
        self.browser.get(self.url)

    def ask(self, script: str) -> Any:
        """Value of a JavaScript expression; ``page`` is the page's own map, layers and picture."""
        return self.browser.execute_script(f"const page = window.groundPicture; return {script};")

    def until(self, script: str, meanwhile: Callable[[], object] = lambda: None) -> Any:
        """Wait until the expression is true; what ``meanwhile`` does is repeated."""
        deadline = time.monotonic() + WITHIN_S
        while not (value := self.ask(script)):
            assert time.monotonic() < deadline, f"{script} did not become true"
            meanwhile()
            time.sleep(0.1)
        return value

    def complaints(self) -> list[str]:
        """Errors in the browser's console: also what the content security policy refused."""
        return [entry["message"] for entry in self.browser.get_log("browser") if entry["level"] == "SEVERE"]


@pytest.fixture
def page(browser: Any, tmp_path: Any) -> Iterator[OpenPage]:
    """A page whose ground process is not started yet."""
    opened = OpenPage(browser, tmp_path)
    browser.get_log("browser")
    yield opened
    browser.get("about:blank")
    if opened.process is not None:
        opened.stop()
