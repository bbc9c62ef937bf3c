"""Messages for maps: Cursor on Target over UDP, and ADSB_VEHICLE, which must never reach an autopilot."""

import socket
import xml.etree.ElementTree as ET
from datetime import UTC, datetime
from pathlib import Path

import pytest
from autopilot_tap import Tap
from sites import Site

AHEAD_S = 5_000.0
"""Difference between the autopilot's UTC and this machine's wall clock, seconds; the autopilot's is the true one."""


@pytest.fixture
def site(tmp_path: Path):
    site = Site(tmp_path)
    yield site
    site.close()


@pytest.fixture
def server():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        sock.settimeout(40.0)
        yield sock


def target_event(server: socket.socket) -> ET.Element:
    """The next event of the selected target; the vehicle and the point that its camera looks at are sent, too."""
    for _ in range(100):
        event = ET.fromstring(server.recv(65536))
        if event.get("uid", "").endswith(".target"):
            return event
    raise AssertionError("no event of the target in a hundred")


@pytest.mark.slow
@pytest.mark.timeout(120)
def test_a_map_gets_the_target_under_a_name_that_lasts_at_true_utc(site: Site, server: socket.socket):
    site.replace('cot = ""', f'cot = "udpout://127.0.0.1:{server.getsockname()[1]}"')
    mock = ("--scenario", "unbiased", "--set", f"autopilot.utc_minus_host_wall_s={AHEAD_S}")
    names = set()
    for _ in range(2):
        with site.service() as service, site.mock(*mock):
            event = target_event(server)
            assert service.stop() == 0
        names.add(event.get("uid"))
    assert len(names) == 1
    reported = datetime.fromisoformat(event.get("time"))
    assert (reported - datetime.now(UTC)).total_seconds() == pytest.approx(AHEAD_S, abs=15.0)
    assert event.get("stale") > event.get("start") == event.get("time")
    point = event.find("point")
    target = site.truth()[0]["targets"][0]
    assert float(point.get("lat")) == pytest.approx(target["lat"], abs=2e-5)
    assert float(point.get("lon")) == pytest.approx(target["lon"], abs=3e-5)
    assert float(point.get("hae")) == pytest.approx(target["alt_amsl"] + 47.0, abs=1.0)
    assert 0.0 < float(point.get("ce")) < 3.0


@pytest.mark.timeout(120)
def test_a_marker_for_maps_never_reaches_the_autopilot(site: Site):
    """Even while the camera uses the autopilot's link, because no ground station's heartbeat is heard."""
    site.replace("adsb = false", "adsb = true")
    with site.service() as service, Tap(site.autopilot_port) as tap:
        site.autopilot_port = tap.port
        with site.mock("--scenario", "unbiased"):
            site.ground.listen(until="ADSB_VEHICLE", count=3)
        assert service.stop() == 0
    assert "CAMERA_TRACKING_GEO_STATUS" in tap.names()
    assert "ADSB_VEHICLE" not in tap.names()
