"""Messages for maps: Cursor on Target over UDP, and ADSB_VEHICLE, which must never reach an autopilot."""

import socket
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest
from autopilot_tap import Tap
from cot_schema import complaints
from processes import free_port
from sites import Site
from tak_server import Authority, TakServer, p12, package, pem

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


def test_service_with_a_tls_link_starts_and_says_why_it_is_not_open(site: Site, tmp_path: Path):
    """The daemon keeps OpenSSL out of memory, unless its configuration needs it."""
    authority = Authority()
    (tmp_path / "ca.pem").write_bytes(pem(authority.certificate))
    site.replace('cot = ""', f'cot = "tls://127.0.0.1:{free_port()}"')
    site.replace('cot_ca = ""', f'cot_ca = "{tmp_path}/ca.pem"')
    with site.service() as service:
        service.wait_for("link cot is down")
        assert service.stop() == 0


@pytest.mark.slow
@pytest.mark.timeout(180)
def test_tak_server_gets_vehicle_view_and_targets_and_never_an_old_place_as_a_new_one(site: Site, tmp_path: Path):
    """By TLS, from a data package alone. After the autopilot's death the vehicle's event keeps its time, and ends."""
    authority, password = Authority(), "atakatak"
    (tmp_path / "ca.p12").write_bytes(p12(None, None, password, [authority.certificate]))
    (tmp_path / "unit.p12").write_bytes(p12(*authority.issue("unit"), password))
    with TakServer(tmp_path, authority, *authority.issue("tak.example")) as server:
        files = (tmp_path / "ca.p12", tmp_path / "unit.p12")
        package(tmp_path / "unit.zip", "127.0.0.1", server.port, *files, password)
        site.replace('cot_package = ""', f'cot_package = "{tmp_path}/unit.zip"')
        with site.service() as service:
            with site.mock("--scenario", "unbiased"):
                wait_for(lambda: {"vehicle", "spi", "target"} <= {kind_of(each) for each in server.events})
            before = len(server.events)
            wait_for(lambda: len([each for each in server.events[before:] if kind_of(each) == "vehicle"]) >= 5)
            time.sleep(STALE_S)
            after = len(server.events)
            time.sleep(3.0)
            assert service.stop() == 0
    assert [complaints(each.partition(b"?>")[2]) for each in server.events] == [[]] * len(server.events)
    repeated = [
        ET.fromstring(each.partition(b"?>")[2]) for each in server.events[before:] if kind_of(each) == "vehicle"
    ]
    times = [datetime.fromisoformat(each.get("time")) for each in repeated[3:]]
    assert (max(times) - min(times)).total_seconds() < 0.5  # of the same place: the clock's estimate moves by less
    assert "vehicle" not in {kind_of(each) for each in server.events[after:]}
    flying = [ET.fromstring(each.partition(b"?>")[2]) for each in server.events[:before] if kind_of(each) == "vehicle"]
    assert flying[-1].find("detail/sensor") is not None


STALE_S = 10.0
"""[publish] cot_stale_s."""


def kind_of(event: bytes) -> str:
    """The last word of an event's uid: vehicle, spi, target, or the number of a track."""
    return ET.fromstring(event.partition(b"?>")[2]).get("uid", "").rpartition(".")[2]


def wait_for(condition: Callable[[], bool]) -> None:
    """Wait until the condition holds."""
    deadline = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.1)


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
