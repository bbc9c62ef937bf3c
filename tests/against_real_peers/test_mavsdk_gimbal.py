"""MAVSDK, which shares no line with pymavlink nor with us, decodes what acting sends, and drives the mock's gimbal."""

import json
import socket
import sys
import time
from pathlib import Path

import pytest
from acting_world import AUTOPILOT, T0, S, a_track, options, situation
from processes import process
from sites import Site

from fwav_companion.acting.aim import Angles
from fwav_companion.acting.follow import Follow
from fwav_companion.acting.gimbal_manager import GimbalManager, Manager
from fwav_companion.acting.roi import Roi
from fwav_companion.mavlink.wire.codec import Encoder
from fwav_companion.types import Outgoing

FOLDER = Path(__file__).parent
SECONDS_S = 90.0


@pytest.fixture
def site(tmp_path: Path):
    site = Site(tmp_path)
    site.close()  # its port is MAVSDK's
    return site


def acting_messages() -> list[Outgoing]:
    """One of each message that acting sends."""
    manager = GimbalManager(1, 191)
    behind = Manager(1, 1, "fc", 1)
    configure = manager._configure(behind, 1.0, 191.0)
    manager.begin(T0)
    manager.manager, manager.control = behind, type(manager.control).OURS
    point = manager.point(Angles(-0.5, 0.25))
    assert point is not None
    roi = Roi(191).due(a_track(), situation(), AUTOPILOT)
    follow = Follow(options()).due(a_track(T0, velocity=(1.5, -0.5, 0.0)), situation(T0 + S // 10))
    return [configure, point, *roi, *follow]


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_mavsdk_decodes_every_message_of_acting_to_what_was_meant(site: Site):
    sent = acting_messages()
    url, ours = f"udpin://127.0.0.1:{site.ground.port}", Encoder(1, 191)
    pilot, beat = Encoder(1, 1), {"type": 2, "autopilot": 3, "base_mode": 128, "custom_mode": 0}
    station = process(url, folder=site.folder, program=(sys.executable, str(FOLDER / "mavsdk_station.py")))
    with station as peer, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        peer.wait_for(r'"listens": true', SECONDS_S)
        for _ in range(400):
            frames = [pilot.encode("HEARTBEAT", {**beat, "system_status": 4, "mavlink_version": 3})]
            frames += [ours.encode(each.name, each.fields) for each in sent] if '"system": true' in peer.said else []
            for frame in frames:
                wire.sendto(frame, ("127.0.0.1", site.ground.port))
            if '"FOLLOW_TARGET"' in peer.said:
                break
            time.sleep(0.2)
        peer.wait_for('"FOLLOW_TARGET"', SECONDS_S)
        peer.stop()
    lines = [json.loads(line) for line in peer.said.splitlines() if line.startswith('{"name"')]
    decoded = {line["name"]: line["fields"] for line in lines if line["component"] == 191}
    for message in sent:
        fields = decoded[message.name]
        for key, meant in message.fields.items():
            if isinstance(meant, float) and meant != meant:
                assert fields[key] is None, "NaN, which JSON does not have"
            elif isinstance(meant, list):
                assert fields[key] == pytest.approx(meant, rel=1e-6)
            else:
                assert fields[key] == pytest.approx(meant, rel=1e-6), (message.name, key)


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_mavsdks_gimbal_plugin_takes_points_and_releases_the_mocks_gimbal(site: Site):
    url = f"udpin://127.0.0.1:{site.ground.port}"
    settings = ("gimbal.device_id=1", "gimbal.manager=true", "gimbal.yaw=vehicle", "draw_biases=false")
    mock = process(
        *("sitl_mock", "--connect", f"udpout:127.0.0.1:{site.ground.port}", "--seconds", "240"),
        *("--scenario", "gimbal", *(word for each in settings for word in ("--set", each))),
        folder=site.folder,
    )
    station = process(url, folder=site.folder, program=(sys.executable, str(FOLDER / "mavsdk_gimbal.py")))
    with station as peer:
        peer.wait_for(r'"listens": true', SECONDS_S)
        with mock as vehicle:
            peer.wait_for(r'"released": true', SECONDS_S)
            peer.stop()
            vehicle.stop()
    said = [json.loads(line) for line in peer.said.splitlines() if line.startswith("{")]
    reported = {name: value for line in said for name, value in line.items()}
    assert (reported["manager"], reported["device"], reported["taken"]) == (1, 1, 245)
    assert (reported["pitch"], reported["yaw"]) == pytest.approx((-40.0, 25.0), abs=1.0)
