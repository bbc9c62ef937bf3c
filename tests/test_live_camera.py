"""The camera component as a ground station meets it: pymavlink over UDP, the daemon and the mock as processes."""

import threading
import time
from collections.abc import Callable
from math import isnan, nan
from pathlib import Path
from typing import Any

import pytest
from autopilot_tap import Tap
from sites import Site

CAMERA, COMPANION = 100, 191
IMAGE, GEO = "CAMERA_TRACKING_IMAGE_STATUS", "CAMERA_TRACKING_GEO_STATUS"
REQUEST_MESSAGE, REQUEST_CAMERA_INFORMATION, SET_INTERVAL = 512, 521, 511
TRACK_POINT, TRACK_RECTANGLE, STOP_TRACKING = 2004, 2005, 2010
ACCEPTED, UNSUPPORTED, FAILED = 0, 3, 4
IDLE, ACTIVE, COASTING = 0, 1, 8
HOVER = (
    *("--scenario", "unbiased", "--set", "flight.pattern=hover", "--set", "flight.pitch_deg=0.0"),
    *("--set", "flight.flapping_pitch_deg=0.0", "--set", "flight.flapping_roll_deg=0.0"),
    *("--set", "flight.wander_m=0.0", "--set", "flight.wander_deg=0.0"),
)
"""Motion so small that a click on the newest picture is also one on the picture of a moment ago."""


@pytest.fixture
def site(tmp_path: Path):
    site = Site(tmp_path)
    yield site
    site.close()


def named(name: str, messages: list[Any]) -> list[Any]:
    return [message for message in messages if message.get_type() == name]


def status(flags: int) -> Callable[[Any], bool]:
    return lambda message: message.get_type() == IMAGE and message.tracking_status == flags


@pytest.mark.timeout(120)
def test_an_operator_finds_the_camera_clicks_and_stops(site: Site):
    with site.service() as service, site.mock(*HOVER, seconds=60.0):
        seen = named(IMAGE, site.ground.listen(until=IMAGE, count=10))[-1]
        for ask in ((REQUEST_MESSAGE, 259.0), (REQUEST_CAMERA_INFORMATION, 1.0)):
            result, _ = site.ground.ask(CAMERA, *ask)
            assert result == ACCEPTED
            (reported,) = named("CAMERA_INFORMATION", site.ground.listen(until="CAMERA_INFORMATION"))
            assert reported.get_srcComponent() == CAMERA
            assert reported.flags & (512 | 1024 | 2048) == 512 | 1024 | 2048
            assert (reported.resolution_h, reported.resolution_v) == (640, 480)
        stopped_and_clicked(site, seen)
        stopped_and_drawn_around(site, seen)
        nothing_there(site)
        assert site.ground.ask(COMPANION, 31_999)[0] == UNSUPPORTED
        assert site.ground.ask(CAMERA, 31_999)[0] == UNSUPPORTED
        assert service.stop() == 0


def stopped_and_clicked(site: Site, seen: Any) -> None:
    """STOP ends it for good; a click on the pixel where the target was brings it back."""
    assert site.ground.ask(CAMERA, STOP_TRACKING)[0] == ACCEPTED
    idle = site.ground.listen_for(status(IDLE))[-1]
    assert (idle.target_data, idle.tracking_mode) == (0, 0)
    assert isnan(idle.point_x)
    site.ground.listen_during(0.5)
    assert named(GEO, site.ground.listen_during(1.0)) == []
    assert site.ground.ask(CAMERA, TRACK_POINT, seen.point_x, seen.point_y, 0.02)[0] == ACCEPTED
    active = site.ground.listen_for(status(ACTIVE))[-1]
    assert active.point_x == pytest.approx(seen.point_x, abs=0.05)
    assert active.point_y == pytest.approx(seen.point_y, abs=0.05)


def stopped_and_drawn_around(site: Site, seen: Any) -> None:
    assert site.ground.ask(CAMERA, STOP_TRACKING)[0] == ACCEPTED
    corners = (seen.point_x - 0.1, seen.point_y - 0.1, seen.point_x + 0.1, seen.point_y + 0.1)
    assert site.ground.ask(CAMERA, TRACK_RECTANGLE, *corners)[0] == ACCEPTED
    site.ground.listen_for(status(ACTIVE))


def nothing_there(site: Site) -> None:
    result, heard = site.ground.ask(CAMERA, TRACK_POINT, 0.02, 0.02, 0.01)
    assert result == FAILED
    heard += site.ground.listen(until="STATUSTEXT")
    assert any(message.text.startswith("tracking: no target there") for message in named("STATUSTEXT", heard))


@pytest.mark.slow
@pytest.mark.timeout(120)
def test_intervals_are_as_asked_for_and_minus_one_stops(site: Site):
    with site.service() as service, site.mock("--scenario", "unbiased", seconds=60.0):
        site.ground.listen(until=GEO, count=3)
        assert rates(site) == {IMAGE: pytest.approx(10.0, abs=2.5), GEO: pytest.approx(10.0, abs=2.5)}
        for message_id in (275, 276):
            assert site.ground.ask(CAMERA, SET_INTERVAL, message_id, -1.0)[0] == ACCEPTED
        assert rates(site) == {IMAGE: 0.0, GEO: 0.0}
        assert site.ground.ask(CAMERA, SET_INTERVAL, 276, 0.0)[0] == ACCEPTED
        assert rates(site) == {IMAGE: 0.0, GEO: pytest.approx(10.0, abs=2.5)}
        assert site.ground.ask(CAMERA, SET_INTERVAL, 275, 500_000.0)[0] == ACCEPTED
        assert site.ground.ask(CAMERA, SET_INTERVAL, 276, 10.0)[0] == ACCEPTED
        reported = rates(site)
        assert reported[IMAGE] == pytest.approx(2.0, abs=0.6)
        assert 20.0 < reported[GEO] <= 51.0, "10 microseconds are not meant"
        assert site.ground.ask(CAMERA, SET_INTERVAL, 30, 100_000.0)[0] == 2
        assert site.ground.ask(CAMERA, SET_INTERVAL, 275, nan)[0] == 2
        assert service.stop() == 0


def rates(site: Site) -> dict[str, float]:
    site.ground.listen_during(0.3)
    heard = site.ground.listen_during(2.0)
    return {name: len(named(name, heard)) / 2.0 for name in (IMAGE, GEO)}


@pytest.mark.timeout(120)
def test_a_target_that_is_not_seen_coasts(site: Site):
    with site.service() as service, site.mock("--scenario", "unbiased", "--set", "camera.stops_at_s=9.0"):
        site.ground.listen_for(status(ACTIVE))
        site.ground.listen_for(status(ACTIVE | COASTING), within_s=40.0)
        geo = named(GEO, site.ground.listen(until=GEO))[-1]
        assert geo.tracking_status == ACTIVE | COASTING
        assert service.stop() == 0


@pytest.mark.timeout(120)
@pytest.mark.slow
def test_with_the_radio_on_the_autopilot_the_camera_speaks_through_it_seldom(site: Site):
    """Until a ground station's heartbeat is heard on a link of its own."""
    with site.service() as service, Tap(site.autopilot_port) as tap:
        site.autopilot_port = tap.port
        service.wait_for("link autopilot is up")
        with site.mock("--scenario", "unbiased", seconds=60.0):
            site.ground.listen(until=GEO, count=3)
            reported = tap.rates(CAMERA, (IMAGE, GEO), 4.0)
            assert reported == {IMAGE: pytest.approx(2.0, abs=0.3), GEO: pytest.approx(2.0, abs=0.3)}
            assert "found" in {m.text[:5] for _, m in tap.seen if m.get_type() == "STATUSTEXT"}
            beating = threading.Event()
            beats = threading.Thread(target=beat_until, args=(site, beating))
            beats.start()
            time.sleep(1.5)
            assert tap.rates(CAMERA, (IMAGE, GEO), 3.0) == {IMAGE: 0.0, GEO: 0.0}
            beating.set()
            beats.join()
        assert service.stop() == 0


def beat_until(site: Site, stop: threading.Event) -> None:
    while not stop.wait(0.5):
        site.ground.beat()
