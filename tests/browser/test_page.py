"""The page in a real browser: read back from the page's own map object."""

from __future__ import annotations

import json
import time

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
    assert "95 % within 2.50 m" in row
    assert "32 m at 338" in row
    page.browser.find_element("css selector", "#targets .row").click()
    assert "target 4" in page.until("!document.getElementById('details').hidden && "
                                    "document.getElementById('details').innerText")  # fmt: skip


def test_units_are_chosen_by_one_switch_that_a_reload_remembers(page, vehicle):
    page.open()
    row = "document.querySelector('#targets .row')?.innerText"
    page.until(f"{row}?.includes(' m at ')", lambda: fly(vehicle))
    switch = page.browser.find_element("id", "units")
    seen = {}
    for _ in range(4):
        seen[switch.text] = page.ask(row)
        switch.click()
    lat = f"{place_of(30.0, -12.0)[0]:.7f}"[:-1]
    for name, text in seen.items():
        assert ("8.2 ft" in text, "2.50 m" in text) == (("ft" in name), "ft" not in name)  # 2.50 / 0.3048
        assert ("32U PU" in text, lat in text) == (("MGRS" in name), "MGRS" not in name)  # Munich's square
    assert len(seen) == 4
    for _ in range(3):
        switch.click()
    assert switch.text == "ft · MGRS"
    page.open()
    page.until(f"{row}?.includes('32U PU') && {row}.includes('8.2 ft')", lambda: fly(vehicle))
    assert page.browser.find_element("css selector", ".leaflet-control-scale").text.endswith("ft")
    page.browser.execute_script("localStorage.setItem('units', '[\"broken\"]')")
    page.open()
    page.until(f"{row}?.includes('2.50 m')", lambda: fly(vehicle))


def test_dead_autopilot_behind_a_live_companion_is_named_and_its_values_turn_grey(page, vehicle):
    page.open()
    page.browser.find_element("id", "tab-vehicles").click()
    ready = "ready: attitude 100 Hz, camera 30/s"
    well = "document.getElementById('well')"
    page.until(f"page && {well}.dataset.level === 'good'", lambda: (fly(vehicle), vehicle.say(ready)))
    values = "[...document.querySelectorAll('#vehicles .value')].map((each) => [each.innerText, each.className])"
    assert not any("stale" in kind for _, kind in page.ask(values))
    page.until("document.querySelector('#vehicles .stale')", vehicle.beat_companion)
    warning = page.until("document.getElementById('warning').textContent", vehicle.beat_companion)
    assert warning.startswith("1: autopilot silent since ")
    page.until("document.querySelectorAll('#vehicles .stale').length >= 7", vehicle.beat_companion)
    shown = dict(page.ask(values))
    for words in (
        "armed (",
        "48.13",
        "20.0 m above home (",
        "heading 90° (",
        "battery 15.8 V 72 % (",
        "ready: attitude",
    ):
        (kind,) = [kind for text, kind in shown.items() if text.startswith(words)]
        assert "stale" in kind, words
    assert "stale" not in shown["companion: healthy"]
    assert page.ask(f"[{well}.dataset.level, {well}.textContent.includes('autopilot silent since')]") == ["bad", True]
    assert page.ask("document.querySelector('#vehicles .tag').textContent") == "silent"
    label = page.ask("page.layers.vehicles.get('1').arrow.getTooltip().getContent()")
    assert label.startswith("1 · ")
    assert label.endswith(" s old")
    assert page.ask("page.layers.vehicles.get('1').shape.getAttribute('fill') === "
                    "getComputedStyle(document.documentElement).getPropertyValue('--old').trim()")  # fmt: skip
    assert not any("heard again" in each for each in page.ask("page.picture.texts.map((each) => each.text)"))


def test_contradicted_claim_is_said_at_a_glance_with_its_instant(page, vehicle):
    page.open()
    sure = "document.getElementById('sure')"
    page.until(f"page && {sure}.textContent.includes('no contradiction known, since')", lambda: fly(vehicle))
    assert page.ask(f"{sure}.textContent").startswith("target 4: 95 % within 2.50 m")
    said = "camera mount: turned by 90 degrees"
    page.until(f"{sure}.dataset.level === 'bad'", lambda: (fly(vehicle), vehicle.say(said)))
    assert f": {said}" in page.ask(f"{sure}.textContent")
    assert "contradicted since " in page.ask(f"{sure}.textContent")


def test_vehicles_have_colours_of_their_own(page, vehicle):
    others = [PictureVehicle(page.mavlink, system) for system in (2, 3)]
    try:
        page.open()
        page.until("page && page.layers.vehicles.size === 3", lambda: [fly(each) for each in (vehicle, *others)])
        drawn = "[each.shape.getAttribute('fill'), each.path.options.color]"
        paints = page.ask(f"[...page.layers.vehicles.values()].map((each) => {drawn})")  # silent ones turn grey
        assert len({fill for fill, _ in paints}) == 3
        assert all(fill == path for fill, path in paints)
    finally:
        for each in others:
            each.close()


def test_export_is_saved_and_one_that_cannot_be_made_says_why(page, vehicle, tmp_path):
    page.open()
    page.until(MARKS, lambda: fly(vehicle))
    browser = page.browser
    browser.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)})
    browser.find_element("css selector", ".menu summary").click()
    browser.find_element("link text", "GeoJSON").click()
    saved = tmp_path / "targets.geojson"
    for _ in range(200):
        if saved.is_file():
            break
        fly(vehicle)
        time.sleep(0.05)
    assert any(each["properties"]["kind"] == "target" for each in json.loads(saved.read_text())["features"])
    why = "UTC is unknown: synchronise this machine's clock (NTP)"  # the server's answer where it is so
    browser.execute_script("window.fetch = async () => new Response(arguments[0], {status: 503});".replace(
        "arguments[0]", json.dumps(why)))  # fmt: skip
    browser.find_element("css selector", ".menu summary").click()
    browser.find_element("link text", "Cursor on Target").click()
    notice = "document.getElementById('notice')"
    assert page.until(f"!{notice}.hidden && {notice}.textContent") == f"Cursor on Target cannot be made: {why}"
    assert page.complaints() == []


RATIOS = """
const luminance = (rgb) => {
  const [r, g, b] = rgb.map((each) => each / 255).map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
};
const parts = (text) => text.match(/[\\d.]+/g).map(Number);
const ground = (element) => {
  for (let at = element; at; at = at.parentElement) {
    const [r, g, b, alpha = 1] = parts(getComputedStyle(at).backgroundColor);
    if (alpha > 0.99) return [r, g, b];
  }
  return [255, 255, 255];
};
const found = [];
for (const each of document.querySelectorAll('body *')) {
  const own = [...each.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
  if (!own || !each.getClientRects().length) continue;
  const a = luminance(parts(getComputedStyle(each).color).slice(0, 3)), b = luminance(ground(each));
  found.push([(Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05), each.textContent.trim().slice(0, 40), each.className]);
}
return found;
"""
"""WCAG 2.2, 1.4.3: contrast of every text that is shown."""
AA = 4.5


@pytest.mark.parametrize("theme", ["light", pytest.param("dark", marks=pytest.mark.slow)])
def test_every_text_has_the_contrast_of_wcag_aa(page, vehicle, theme):
    page.open()
    page.browser.execute_script(f"document.documentElement.dataset.theme = '{theme}';")
    said = ("found person 7: 48.1373, 11.5757, 95 % within 2.4 m", "not ready: no pictures: check")
    page.until(f"{MARKS} && document.querySelector('#targets .row')",
               lambda: (fly(vehicle), *map(vehicle.say, said)))  # fmt: skip
    page.until("document.querySelector('#targets .row.old')", lambda: fly(vehicle))
    measured = []
    for tab in ("vehicles", "texts", "targets"):
        page.browser.find_element("id", f"tab-{tab}").click()
        measured += page.browser.execute_script(RATIOS)
    page.browser.find_element("css selector", "#targets .row").click()
    page.browser.find_element("css selector", ".menu summary").click()
    page.until("!document.getElementById('warning').hidden")
    measured += page.browser.execute_script(RATIOS)
    texts = " ".join(text for _, text, _ in measured)
    assert all(words in texts for words in ("was reported", "no pictures", "silent", "GeoJSON", "m · °"))
    assert [each for each in measured if each[0] < AA] == []


def test_a_silent_vehicle_and_a_lost_connection_are_reported_and_the_page_comes_back(page, vehicle):
    page.open()
    page.until(MARKS, lambda: fly(vehicle))
    warning = "document.getElementById('warning')"
    page.until(f"!{warning}.hidden && {warning}.textContent.includes('1: all silent since')")
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


BOXES = (
    "[...document.querySelectorAll('button, summary, .leaflet-bar a')].filter((each) => each.offsetParent)"
    ".map((each) => [each.innerText.slice(0, 20),"
    " ...['width', 'height', 'top'].map((name) => each.getBoundingClientRect()[name])])"
)
"""[name, width, height, top] of everything that is pressed."""


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
        page.until("document.getElementById('count-vehicles').textContent === '1'", lambda: fly(vehicle))
        boxes = page.ask(BOXES)
        assert {name for name, *_ in boxes} >= {"Show all", "Export", "+", "Vehicles 1"}
        assert [name for name, width, height, _ in boxes if min(width, height) < 44.0] == []
        reach = 844 * 0.3  # a thumb's, from the bottom: the upper 30 % needs the other hand
        assert [name for name, _, _, top in boxes if top < reach] == []
        lowest = [name for name, _, _, top in boxes if top > 844 * 0.85]
        assert {"Show all", "Set point", "Vehicles 1", "Export"} <= set(lowest)
        back = page.ask("getComputedStyle(document.body).backgroundColor")
        light = sum(json.loads("[" + back.partition("(")[2].rstrip(")") + "]")) > 3 * 128
        assert light == (theme == "light")
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
