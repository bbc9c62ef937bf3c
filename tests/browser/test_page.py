"""The page in a real browser: read back from the page's own map object."""

from __future__ import annotations

import json

import pytest
from picture_vehicles import HOME, PictureVehicle, place_of

pytest.importorskip("aiohttp")

MARKS = "page && page.layers.targets.size"
NEAR_DEG = 2e-7
"""1e-7 degrees are the message's resolution."""


@pytest.fixture
def vehicle(page):
    page.start()
    sender = PictureVehicle(page.mavlink)
    yield sender
    sender.close()


def fly(vehicle: PictureVehicle) -> None:
    vehicle.beat()
    vehicle.health()
    vehicle.camera()
    vehicle.fly(0.0, 0.0, heading_deg=90.0)
    vehicle.target(30.0, -12.0, track=4, radius95=2.5, sigma=1.1)


def test_the_target_is_where_the_vehicle_says_and_its_ellipse_has_its_size(page, vehicle):
    page.open()
    page.until(MARKS, lambda: fly(vehicle))
    lat, lon = place_of(30.0, -12.0)
    shown = page.until("(() => { const m = page.layers.targets.get('1/4'); return m && m.centre.getLatLng(); })()")
    assert (shown["lat"], shown["lng"]) == pytest.approx((lat, lon), abs=NEAR_DEG)
    radii = page.ask(
        "(() => { const m = page.layers.targets.get('1/4'); const at = m.centre.getLatLng();"
        " return m.ellipse.getLatLngs()[0].map((corner) => page.map.distance(at, corner)); })()"
    )
    # Leaflet measures on a sphere, 0.34 % off at most; the page draws on WGS84.
    assert len(radii) == 48
    assert all(radius == pytest.approx(2.5, rel=0.005) for radius in radii)
    assert page.complaints() == []


def test_the_vehicle_has_its_place_heading_and_footprint(page, vehicle):
    page.open()
    page.until("page && page.picture.vehicles.get('1')?.footprint.length", lambda: fly(vehicle))
    page.until("page.layers.vehicles.get('1')?.footprint.getLatLngs()[0].length === 4", lambda: fly(vehicle))
    at = page.ask("page.layers.vehicles.get('1').arrow.getLatLng()")
    assert (at["lat"], at["lng"]) == pytest.approx(HOME[:2], abs=NEAR_DEG)
    assert page.ask("page.layers.vehicles.get('1').shape.getAttribute('transform')").startswith("rotate(90")
    corners = page.ask("page.layers.vehicles.get('1').footprint.getLatLngs()[0]")
    assert max(corner["lat"] for corner in corners) > HOME[0] > min(corner["lat"] for corner in corners)


def test_the_list_has_position_mgrs_accuracy_and_distance_from_the_point(page, vehicle):
    page.open()
    page.until(MARKS, lambda: fly(vehicle))
    text = "document.querySelector('#targets .row')?.innerText"
    row = page.until(f"{text}?.includes(' m at ') && {text}", lambda: fly(vehicle))  # the point may come later
    lat, lon = place_of(30.0, -12.0)
    assert f"{lat:.7f}"[:-1] in row
    assert f"{lon:.7f}"[:-1] in row
    assert "32U PU" in row  # Munich's square
    assert "95 % within 2.50 m" in row
    assert "32 m at 338" in row
    page.browser.find_element("css selector", "#targets .row").click()
    assert "target 4" in page.until("!document.getElementById('details').hidden && "
                                    "document.getElementById('details').innerText")  # fmt: skip


def test_a_silent_vehicle_and_a_lost_connection_are_reported_and_the_page_comes_back(page, vehicle):
    page.open()
    page.until(MARKS, lambda: fly(vehicle))
    warning = "document.getElementById('warning')"
    page.until(f"!{warning}.hidden && {warning}.textContent.includes('Silent: 1')")
    page.stop()
    page.until(f"{warning}.textContent.includes('No connection')")
    page.until("document.getElementById('state').dataset.state === 'lost'")
    page.start()
    page.until("document.getElementById('state').dataset.state === 'live'")
    page.until(f"{MARKS} && {warning}.hidden", lambda: fly(vehicle))


def test_nothing_is_loaded_from_outside_and_the_policy_holds(page, vehicle):
    page.open()
    page.until(MARKS, lambda: fly(vehicle))
    loaded = page.ask("performance.getEntriesByType('resource').map((entry) => entry.name)")
    assert loaded
    assert all(name.startswith(page.url) for name in loaded)
    page.browser.execute_script("const s = document.createElement('script'); s.textContent = 'window.injected = 1';"
                                "document.body.append(s);")  # fmt: skip
    assert page.ask("window.injected === undefined")
    assert any("Content Security Policy" in complaint for complaint in page.complaints())


def test_markup_in_names_is_shown_as_text(page, vehicle):
    """Labels come from radios: a name must not become an element of the page."""
    page.open()
    text = "found <img src=x onerror=alert(1)> 9: 48.137300, 11.575700, 95 % within 2.4 m"
    page.until(MARKS, lambda: (fly(vehicle), vehicle.say(text)))
    page.until("document.querySelector('#targets').innerText.includes('<img')", lambda: fly(vehicle))
    assert page.ask("document.querySelectorAll('#map .name img, #targets img').length") == 0


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_a_phone_s_width_holds_everything_and_buttons_fit_a_finger(page, vehicle, theme):
    browser = page.browser
    phone = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", phone)
    wanted = {"features": [{"name": "prefers-color-scheme", "value": theme}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", wanted)
    try:
        page.open()
        page.until(MARKS, lambda: fly(vehicle))
        assert page.ask("document.documentElement.dataset.theme") == theme
        assert page.ask("document.documentElement.scrollWidth") <= 390
        heights = page.ask("[...document.querySelectorAll('button, summary')].filter((each) => each.offsetParent)"
                           ".map((each) => each.getBoundingClientRect().height)")  # fmt: skip
        assert heights
        assert min(heights) >= 44.0
        back = page.ask("getComputedStyle(document.body).backgroundColor")
        light = sum(json.loads("[" + back.partition("(")[2].rstrip(")") + "]")) > 3 * 128
        assert light == (theme == "light")
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
