"""Vehicles in local worlds on the page: read back from what is drawn, by its own axes and scale bar."""

from __future__ import annotations

import sys
from pathlib import Path

import local_fleet
import pytest
from local_fleet import HEADING_DEG, PLACES, SEEN
from processes import Process

pytest.importorskip("aiohttp")

FLEET = Path(local_fleet.__file__)
DRAWN = """
(() => {
  const svg = document.querySelector(`#grids svg[aria-label="Local grid of vehicle VEHICLE"]`);
  if (!svg) return null;
  const [upright, level] = ['x1', 'y1'].map((name) => [...svg.querySelectorAll('.axis')]
    .filter((line) => line.getAttribute(name) === line.getAttribute(name.replace('1', '2'))));
  const bar = svg.querySelector('.ruler').getBBox();
  const box = (each) => { const { x, y, width, height } = each.getBBox(); return [x, y, width, height]; };
  return {
    zero: [Number(upright[0].getAttribute('x1')), Number(level[0].getAttribute('y1'))],
    bar: [bar.width, svg.querySelector('.ruler + text').textContent],
    arrow: svg.querySelector('.arrow').getAttribute('transform').match(/-?[\\d.]+/g).map(Number),
    paint: svg.querySelector('.arrow').getAttribute('fill'),
    ellipses: Object.fromEntries([...svg.querySelectorAll('polygon')].map((each) => [each.dataset.target, box(each)])),
    paints: Object.fromEntries([...svg.querySelectorAll('circle')].map((each) =>
      [each.dataset.target, each.getAttribute('fill')])),
    names: [...svg.querySelectorAll('.name')].map((each) => each.textContent),
  };
})()
"""
"""What the grid of a vehicle shows, in pixels."""
AXIS_95 = 2.4477
"""Semi-axis of the 95 % ellipse in sigmas: the root of -2 ln 0.05."""


def drawn(vehicle: str) -> str:
    return DRAWN.strip().replace("VEHICLE", vehicle)


@pytest.fixture
def found(page, tmp_path):
    """The file whose existence gives vehicle 1 a global position; the page is open."""
    file = tmp_path / "found"
    page.process = Process(str(FLEET), str(page.http), str(file), folder=tmp_path, program=(sys.executable,))
    page.process.wait_for("serving")
    page.open()
    return file


def metres(shown: dict, x: float, y: float) -> tuple[float, float]:
    """(north, east) of a pixel by the axes and the scale bar."""
    width, text = shown["bar"]
    length_m, unit = text.split()
    assert unit == "m"
    return (shown["zero"][1] - y) * float(length_m) / width, (x - shown["zero"][0]) * float(length_m) / width


def test_vehicle_without_a_place_on_the_earth_is_on_a_grid_of_its_own_and_goes_over_to_the_map(page, found):
    shown = page.until(f"(({drawn('1')})?.ellipses ?? {{}})['1/local/4'] && {drawn('1')}")
    x, y, turn = shown["arrow"]
    assert metres(shown, x, y) == pytest.approx((PLACES["1"].north, PLACES["1"].east), abs=0.05)
    assert turn == HEADING_DEG
    left, top, width, height = shown["ellipses"]["1/local/4"]
    assert metres(shown, left + width / 2, top + height / 2) == pytest.approx((SEEN.north, SEEN.east), abs=0.05)
    (upper, outer), (lower, inner) = metres(shown, left + width, top), metres(shown, left, top + height)
    assert (upper - lower) / 2 == pytest.approx(AXIS_95 * 0.5, rel=0.05)
    assert (outer - inner) / 2 == pytest.approx(AXIS_95 * 0.2, rel=0.05)
    assert (shown["paints"]["1/local/4"], shown["paints"]["1/local/8"]) == ("var(--target)", "var(--old)")
    assert {"person 4", "bag 8 · 60 s old", "1"} <= {name.replace("61 s", "60 s") for name in shown["names"]}
    other = page.until(drawn("2"))
    x, y, _ = other["arrow"]
    assert metres(other, x, y) == pytest.approx((PLACES["2"].north, PLACES["2"].east), abs=0.02)
    assert other["paint"] != shown["paint"]
    assert not other["ellipses"], "what vehicle 1 sees is on its own grid"
    assert page.ask("document.getElementById('map').hidden"), "nothing has a place on the earth"

    row = page.until("document.querySelector('#targets .row')?.innerText")
    assert "4.00 m S, 5.00 m E of the zero of vehicle 1" in row
    assert page.ask("document.getElementById('count-targets').textContent") == "2"
    page.browser.find_element("id", "tab-vehicles").click()
    rows = page.until("document.querySelector('#vehicles .row') && document.getElementById('vehicles').innerText")
    assert "local: 3.00 m N, 2.00 m W, 1.5 m above its zero" in rows
    assert "no position yet" not in rows

    found.touch()
    page.until("page.layers.vehicles.size === 1 && page.layers.targets.size === 1")
    at = page.ask("page.layers.vehicles.get('1').arrow.getLatLng()")
    assert (at["lat"], at["lng"]) == pytest.approx((48.0, 11.0), abs=1e-7)
    page.until(f"{drawn('1')} === null && !document.getElementById('map').hidden")
    assert page.ask("page.map.getSize().y") > 100
    assert page.ask("page.map.getBounds().contains([48.0, 11.0]) && page.map.getZoom() > 15")
    assert page.ask(f"({drawn('2')}) !== null")
    page.until("[...page.picture.targets.keys()].every((id) => id.startsWith('fleet/'))")
    assert page.complaints() == []


def test_tap_on_a_local_target_selects_it(page, found):
    from selenium.webdriver import ActionChains

    shown = page.until(f"(({drawn('1')})?.ellipses ?? {{}})['1/local/4'] && {drawn('1')}")
    left, top, width, height = shown["ellipses"]["1/local/4"]
    svg = page.browser.find_element("css selector", "#grids svg")
    middle = [svg.size["width"] / 2, svg.size["height"] / 2]
    place = (left + width / 2 + 6 - middle[0], top + height / 2 - middle[1])
    ActionChains(page.browser).move_to_element_with_offset(svg, *map(round, place)).click().perform()
    text = page.until("!document.getElementById('details').hidden && document.getElementById('details').innerText")
    assert "person 4" in text
    assert "4.00 m S, 5.00 m E of the zero of vehicle 1" in text
