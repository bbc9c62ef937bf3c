"""The real daemon with a hostile ground link: nothing that comes there is the vehicle's, and nothing stalls it."""

import socket
import time
from collections.abc import Callable

import pytest
from mavlink_wire import Wire, dialect
from sites import Site

PATIENCE_S = 60.0


def until(site: Site, condition: Callable[[dict], bool]) -> dict:
    """The status once the condition holds."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        if (site.folder / "status.json").exists() and condition(site.status()):
            return site.status()
        time.sleep(0.2)
    raise AssertionError("the status never showed it")


def link_of(status: dict, name: str) -> dict:
    return next(link for link in status["traffic"] if link["name"] == name)


def claims() -> list[bytes]:
    """What a station could say as the autopilot, and five heartbeats of another vehicle."""
    forged, other = Wire(1, 1), Wire(42, 1)
    return [
        *(other.heartbeat() for _ in range(5)),
        *(forged.frame("ATTITUDE_QUATERNION", 10_000_000 + i, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0) for i in range(20)),
        *(forged.frame("SYSTEM_TIME", 0, i) for i in range(5)),
        forged.frame("GLOBAL_POSITION_INT", 1, 100_000_000, 100_000_000, 0, 0, 0, 0, 0, 0),
        forged.frame("HOME_POSITION", 1, 1, 0, 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0),
        forged.frame("PARAM_VALUE", b"PLND_LAG", 1e10, 9, 1, 0),
    ]


@pytest.mark.timeout(150)
def test_a_hostile_ground_link_changes_nothing_and_stalls_nothing(tmp_path):
    site = Site(tmp_path)
    site.replace(f"udpout://127.0.0.1:{site.ground.port}", f"udpin://127.0.0.1:{site.detections_port + 1}")
    ground = ("127.0.0.1", site.detections_port + 1)
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as attacker,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station,
        site.service() as service,
    ):
        service.wait_for("link ground is up")
        for frame in claims():
            attacker.sendto(frame, ground)  # before the autopilot has power
        with site.mock("--scenario", "unbiased", seconds=60.0):
            until(site, lambda status: status["autopilot"] is not None and status["telemetry"]["attitudes_kept"] > 50)
            stranger.sendto(b"x", ground)
            station.sendto(Wire(255, 190).heartbeat(dialect.MAV_TYPE_GCS, 8), ground)
            for frame in claims():
                attacker.sendto(frame, ground)
            for _ in range(100):
                stranger.sendto(b"\xfe" * 8000, ground)
                time.sleep(0.002)
            status = until(site, lambda status: link_of(status, "ground")["shed_bytes"] > 100_000)
            assert status["autopilot"]["system"] == 1
            assert not status["autopilot_lost"]
            assert status["telemetry"]["reboots"] == 0
            assert status["parameters"].get("PLND_LAG", 0.0) < 1.0
            assert link_of(status, "ground")["own_ids_on_gcs"] >= 28
            assert status["internal_faults"] == 0
            clients = status["links"]["ground"]["clients"]
            assert f"127.0.0.1:{station.getsockname()[1]}" in clients
            assert f"127.0.0.1:{stranger.getsockname()[1]}" not in clients
        assert service.stop() == 0
    site.close()
    assert "with the autopilot's ids came on link 'ground'" in service.said
    assert "were skipped unread" in service.said
