"""The page of `locate` in a real browser: clicked with its mouse, read back from its own maps."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import cv2
import numpy as np
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

    def __init__(self, browser: Any, shown: Path, *options: str) -> None:
        """``shown``: a folder of pictures, or a video."""
        self.browser, self.port = browser, free_port()
        folder = shown if shown.is_dir() else shown.parent
        words = ("locate", str(shown), "--http", f"127.0.0.1:{self.port}", *options)
        self.process = Process("fwav_companion", *words, folder=folder)
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

    def close(self) -> None:
        """Leave the page and end its server."""
        self.browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        self.browser.get("about:blank")
        self.process.kill()

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
    opened.close()


@pytest.fixture
def video_page(browser: Any, tmp_path: Path) -> Iterator[LocatePage]:
    """Three seconds of a gimbal that looks 60 degrees down from 40 m; the drone flies 11 m/s to the north."""
    writer = cv2.VideoWriter(str(tmp_path / "DJI_0001.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (160, 90))
    for brightness in range(30):
        writer.write(np.full((90, 160, 3), 8 * brightness, np.uint8))
    writer.release()
    (tmp_path / "DJI_0001.SRT").write_text(
        "".join(
            f"{at + 1}\n00:00:0{at},000 --> 00:00:0{at + 1},000\n[latitude: {47.0 + 1e-4 * at:.6f}] [longitude: 11.0] "
            "[rel_alt: 40.0 abs_alt: 440.0] [focal_len: 240] [gb_yaw: 0.0 gb_pitch: -60.0 gb_roll: 0.0]\n\n"
            for at in range(3)
        )
    )
    browser.get_log("browser")
    opened = LocatePage(browser, tmp_path / "DJI_0001.avi")
    yield opened
    opened.close()


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
    assert "2 pictures cannot show" in opened.ask("document.querySelector('#assumed li').textContent")
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


@pytest.mark.parametrize("width", WIDTHS)
def test_click_in_a_frame_of_a_video_is_drawn_in_the_frame_that_the_scrubber_shows(video_page, width: int):
    from selenium.webdriver import Keys

    video_page.open(width)
    assert video_page.ask("document.documentElement.scrollWidth") <= width
    assert video_page.ask("document.getElementById('scrubber').checkVisibility()")
    slider = video_page.browser.find_element("id", "time")
    slider.send_keys(Keys.HOME)
    video_page.until("locatePage.shown() === 'DJI_0001.avi@0.000'")
    video_page.click_pixel(80.0, 30.0)
    target = video_page.until("locatePage.state().answers?.targets[0]")
    assert target["pictures"][0]["file"] == "DJI_0001.avi@0.000"
    video_page.browser.find_element("id", "forward").click()
    video_page.until("locatePage.shown() === 'DJI_0001.avi@1.000'")
    video_page.until("document.querySelectorAll('#picture path[stroke-dasharray]').length")
    find = "locatePage.state().answers.targets[0].expected.find((each) => each.file === 'DJI_0001.avi@1.000')"
    expected = video_page.until(find)
    assert expected["v"] > 40.0  # the drone has flown towards it
    assert [each for each in video_page.browser.get_log("browser") if each["level"] == "SEVERE"] == []


def test_own_tiles_lie_below_the_map_and_nothing_comes_from_elsewhere(browser, tmp_path):
    """World tiles of zoom 0 to 2, one colour each."""
    write_set(tmp_path, 2)
    with closing(sqlite3.connect(tmp_path / "world.mbtiles")) as database:
        database.execute("CREATE TABLE metadata (name text, value text)")
        database.execute("CREATE TABLE tiles (zoom_level int, tile_column int, tile_row int, tile_data blob)")
        for zoom in range(3):
            png = cv2.imencode(".png", np.full((256, 256, 3), 80 + 40 * zoom, np.uint8))[1].tobytes()
            places = [(zoom, column, row, png) for column in range(2**zoom) for row in range(2**zoom)]
            database.executemany("INSERT INTO tiles VALUES (?, ?, ?, ?)", places)
        database.commit()
    opened = LocatePage(browser, tmp_path, "--tiles", str(tmp_path / "world.mbtiles"))
    try:
        opened.open()
        opened.until("[...document.querySelectorAll('#map img.leaflet-tile-loaded')].some((each) => each.naturalWidth)")
        own = f"http://127.0.0.1:{opened.port}/"
        loaded = opened.ask("performance.getEntriesByType('resource').map((each) => each.name)")
        assert any(name.startswith(f"{own}tiles/2/") for name in loaded)
        assert [name for name in loaded if not name.startswith(own)] == []
    finally:
        opened.close()
