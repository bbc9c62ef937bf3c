"""The page of `locate` in a real browser: clicked with its mouse, read back from its own maps."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from processes import Process, free_port

from tests.support.clicked_pictures import mark_place, write_set

pytest.importorskip("aiohttp")

WITHIN_S = 20.0
"""Limit of every wait: a hang, not slowness."""
READY = "window.locatePage?.shown() && document.querySelectorAll('#strip button').length"
WIDTHS = (1300, 400)


class LocatePage:
    """The open page."""

    def __init__(self, browser: Any, folder: Path) -> None:
        self.browser, self.folder, self.port = browser, folder, free_port()
        self.process = Process(
            "fwav_companion", "locate", str(folder), "--http", f"127.0.0.1:{self.port}", folder=folder
        )
        self.process.wait_for("pictures and map: http")

    def open(self, width: int = 1300) -> None:
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
        self.browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        self.browser.get(f"http://127.0.0.1:{self.port}/")
        self.until(READY)

    def ask(self, script: str) -> Any:
        return self.browser.execute_script(f"return {script};")

    def until(self, script: str) -> Any:
        deadline = time.monotonic() + WITHIN_S
        while not (value := self.ask(script)):
            assert time.monotonic() < deadline, f"{script} did not become true"
            time.sleep(0.05)
        return value

    def click_pixel(self, u: float, v: float) -> None:
        """Click with the mouse where the page shows this pixel."""
        from selenium.webdriver import ActionChains

        self.until("document.querySelector('#picture img')?.complete")
        place = self.ask(f"(() => {{ const p = locatePage.view.map.latLngToContainerPoint([{-v}, {u}]);"
                         "const box = document.getElementById('picture').getBoundingClientRect();"
                         "return [p.x - box.width / 2, p.y - box.height / 2]; })()")  # fmt: skip
        element = self.browser.find_element("id", "picture")
        ActionChains(self.browser).move_to_element_with_offset(element, *map(round, place)).click().perform()


@pytest.fixture
def page(browser: Any, tmp_path: Path) -> Iterator[tuple[LocatePage, list]]:
    pictures = write_set(tmp_path, 3)
    browser.get_log("browser")
    opened = LocatePage(browser, tmp_path)
    yield opened, pictures
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    browser.get("about:blank")
    opened.process.kill()


@pytest.mark.parametrize("width", WIDTHS)
def test_mouse_clicks_give_a_place_that_tightens_and_is_drawn_in_the_other_pictures(page, width: int):
    opened, pictures = page
    opened.open(width)
    assert opened.ask("document.documentElement.scrollWidth") <= width
    opened.click_pixel(*pictures[0][1]["car"])
    first = opened.until("locatePage.state().answers.targets[0]?.radius95_m")
    assert "saved in locate-clicks.csv" in opened.until("document.getElementById('saved').textContent")
    expected = opened.ask("locatePage.state().answers.targets[0].expected")
    assert [each["file"] for each in expected] == [path.name for path, _ in pictures[1:]]
    opened.browser.find_elements("css selector", "#strip button")[1].click()
    opened.until("locatePage.shown() === 'DJI_0001.JPG'")
    dashed = opened.until("[...document.querySelectorAll('#picture path[stroke-dasharray]')].length")
    assert dashed >= 1
    assert opened.ask("document.querySelector('#picture .name').textContent") == "target 1?"
    opened.click_pixel(*pictures[1][1]["car"])
    opened.until("locatePage.state().answers.targets[0].pictures.length === 2")
    target = opened.ask("locatePage.state().answers.targets[0]")
    assert target["radius95_m"] < first
    lat, lon = mark_place("car")
    assert abs(target["lat"] - lat) * 111_000 < target["radius95_m"]
    assert abs(target["lon"] - lon) * 76_000 < target["radius95_m"]
    row = opened.ask("document.querySelector('#targets .row').innerText")
    assert "32T PT" in row
    assert "2 pictures" in row
    assert [each for each in opened.browser.get_log("browser") if each["level"] == "SEVERE"] == []


def test_name_and_second_target_are_kept_when_the_page_is_opened_again(page):
    from selenium.webdriver import Keys

    opened, pictures = page
    opened.open()
    opened.click_pixel(*pictures[0][1]["car"])
    opened.until("locatePage.state().clicks.length === 1")
    name = opened.browser.find_element("id", "label")
    name.send_keys(Keys.CONTROL + "a")
    name.send_keys("my car", Keys.ENTER)
    opened.until("locatePage.state().clicks[0].label === 'my car'")
    opened.browser.find_element("id", "next").click()
    opened.click_pixel(*pictures[0][1]["barrel"])
    opened.until("locatePage.state().answers.targets.length === 2")
    opened.open()
    opened.until("document.querySelectorAll('#targets .row').length === 2")
    labels = opened.ask("[...document.querySelectorAll('#targets .row')].map((each) => each.dataset.label)")
    assert labels == ["my car", "target 1"]
    opened.browser.find_element("id", "remove").click()
    opened.until("locatePage.state().clicks.length === 1")
