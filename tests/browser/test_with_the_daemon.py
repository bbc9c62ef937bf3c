"""The page with the daemon and the mock behind it: the way from a pixel to a place on the browser's map."""

from __future__ import annotations

from math import cos, hypot, radians

import pytest
from sites import Site

pytest.importorskip("aiohttp")

M_A_DEGREE = 111_320.0
TARGETS = "[...page.picture.targets.values()].filter((each) => each.state === 'confirmed' || each.state === 'selected')"
WELL = "document.getElementById('well')"


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_the_mock_s_target_is_at_its_place_and_the_daemon_may_start_again(page, tmp_path):
    """Without noise or bias the place on the map is the truth; the page shows the daemon's end and return, and
    the autopilot's death behind it."""
    site = Site(tmp_path)
    site.replace(f"127.0.0.1:{site.ground.port}", f"127.0.0.1:{page.mavlink}")
    page.start("--link", f"udpin://127.0.0.1:{page.mavlink}", "--status", str(tmp_path / "status.json"))
    page.open()
    warning = "document.getElementById('warning')"
    try:
        with site.mock("--scenario", "perfect", seconds=200.0) as mock:
            with site.service() as first:
                page.until(f"{TARGETS}.length && page.layers.targets.size")
                truth = site.truth()[0]["targets"][0]
                shown = page.ask("[...page.layers.targets.values()][0].centre.getLatLng()")
                north = (shown["lat"] - truth["lat"]) * M_A_DEGREE
                east = (shown["lng"] - truth["lon"]) * M_A_DEGREE * cos(radians(truth["lat"]))
                assert hypot(north, east) < 1.0
                first.kill()
            page.until(f"!{warning}.hidden && {warning}.textContent.includes('silent since')")
            with site.service():
                page.until(f"{warning}.hidden && {TARGETS}.length && {WELL}.dataset.level === 'good'")
                mock.kill()  # now the autopilot dies, and the companion lives on
                page.until(f"!{warning}.hidden && {warning}.textContent.startsWith('1: autopilot silent since')")
                page.until("page.layers.vehicles.get('1').arrow.getTooltip().getContent().endsWith(' s old')")
                assert page.ask(f"{WELL}.dataset.level") == "bad"
                said = page.ask("page.picture.texts.map((each) => each.text)")
                assert sum("heard again" in each for each in said) == 1  # the companion, after its restart
    finally:
        site.close()
    assert page.complaints() == []
