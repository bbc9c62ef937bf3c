"""MAVSDK, which shares no line with pymavlink nor with us, decodes what acting sends, and drives the mock's gimbal."""

import json
import re
import socket
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import isnan, radians
from pathlib import Path
from threading import Event, Thread

import msgspec
import pytest
from acting_world import AUTOPILOT, CONFIGURE, REQUEST, ROI, ROI_NONE, T0, S, a_track, message, options, situation
from processes import process
from sites import Site

from fwav_companion.acting.aim import Angles
from fwav_companion.acting.follow import Follow
from fwav_companion.acting.gimbal_manager import GimbalManager
from fwav_companion.acting.roi import Roi
from fwav_companion.mavlink.wire.codec import Encoder
from fwav_companion.types import Outgoing

FOLDER = Path(__file__).parent
SECONDS_S = 90.0
INTERVAL_S = 0.2
TARGETS = {"target_system": 245, "target_component": 190}
"""Ids of a ground station of MAVSDK."""


@pytest.fixture
def site(tmp_path: Path):
    site = Site(tmp_path)
    site.close()  # its port is MAVSDK's
    return site


def gimbal_messages() -> list[Outgoing]:
    """The dialogue with a gimbal manager: requests, taking, an angle, release."""
    manager, ours = GimbalManager(1, 191), (AUTOPILOT.our_system, 191)
    manager.begin(T0)
    sent = manager.on_wake(T0, AUTOPILOT)
    limits = {"pitch_min": radians(-90), "pitch_max": radians(30), "yaw_min": radians(-170), "yaw_max": radians(170)}
    manager.on_message(message("GIMBAL_MANAGER_INFORMATION", gimbal_device_id=1, **limits), AUTOPILOT)
    for primary in ((0, 0), ours):
        fields = {"gimbal_device_id": 1, "primary_control_sysid": primary[0], "primary_control_compid": primary[1]}
        manager.on_message(message("GIMBAL_MANAGER_STATUS", flags=12, **fields), AUTOPILOT)
        sent += manager.on_wake(T0 + S, AUTOPILOT)
    point = manager.point(Angles(-0.5, 0.25))
    assert point is not None
    return [*sent, point, *manager.end(AUTOPILOT)]


def acting_messages() -> list[Outgoing]:
    """Every kind of message that acting sends."""
    roi = Roi(191)
    placed = roi.due(a_track(), situation(), AUTOPILOT)
    moving, still = Follow(options()), Follow(options())
    followed = moving.due(a_track(T0, velocity=(1.5, -0.5, 0.0)), situation(T0 + S // 10))
    messages = [*gimbal_messages(), *placed, *roi.clear(AUTOPILOT), *followed, *still.due(a_track(), situation())]
    return [for_station(each) for each in messages]


def for_station(sent: Outgoing) -> Outgoing:
    """The message with MAVSDK as its addressee: MAVSDK hands on none that is for another."""
    targets = {name: value for name, value in TARGETS.items() if name in sent.fields}
    return msgspec.structs.replace(sent, fields={**sent.fields, **targets})


@contextmanager
def repeated(site: Site, sent: Sequence[Outgoing]) -> Iterator[None]:
    """Sends an autopilot's heartbeat and these messages again and again: a datagram may be lost."""
    pilot, ours, stopped = Encoder(1, 1), Encoder(1, 191), Event()
    beat = {"type": 2, "autopilot": 3, "base_mode": 128, "custom_mode": 0, "system_status": 4, "mavlink_version": 3}

    def send() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
            while not stopped.wait(INTERVAL_S):
                frames = [pilot.encode("HEARTBEAT", beat), *(ours.encode(each.name, each.fields) for each in sent)]
                for frame in frames:
                    wire.sendto(frame, ("127.0.0.1", site.ground.port))

    sender = Thread(target=send)
    sender.start()
    try:
        yield
    finally:
        stopped.set()
        sender.join()


def assert_decoded_as_meant(meant: Outgoing, decoded: list[dict]) -> None:
    """One of the decoded messages has every field as it was meant; NaN is null, which JSON has."""
    expected = {
        key: None if isinstance(value, float) and isnan(value) else pytest.approx(value, rel=1e-6)
        for key, value in meant.fields.items()
    }
    assert expected in [{key: fields[key] for key in expected} for fields in decoded], (meant, decoded)


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_mavsdk_decodes_every_message_of_acting_to_what_was_meant(site: Site):
    sent = acting_messages()
    commands = {each.fields["command"] for each in sent if "command" in each.fields}
    assert commands == {CONFIGURE, REQUEST, ROI, ROI_NONE}
    url = f"udpin://127.0.0.1:{site.ground.port}"
    station = process(url, folder=site.folder, program=(sys.executable, str(FOLDER / "mavsdk_station.py")))
    with station as peer:
        peer.wait_for(r'"listens": true', SECONDS_S)
        with repeated(site, sent):
            peer.wait_for(r'"system": true', SECONDS_S)
            peer.wait_for(r'(?s)("FOLLOW_TARGET".*?){5}\n', SECONDS_S)
        peer.stop()
    lines = [json.loads(line) for line in peer.said.splitlines() if re.fullmatch(r'\{"name".*\}', line)]
    for meant in sent:
        assert_decoded_as_meant(
            meant, [line["fields"] for line in lines if (line["name"], line["component"]) == (meant.name, 191)]
        )


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
