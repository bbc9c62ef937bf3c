"""Every message forged: id by sender, version, phase of the flight and link, against the daemon without its shell.

A second daemon flies beside it unattacked: what a station's link may not move is the same in both.
"""

from __future__ import annotations

import random
import struct
from collections.abc import Iterator

import msgspec
import pytest
from fastcrc.crc16 import mcrf4xx
from fuzz_targets import KEY, LINKS, RADIO, Daemon, framed
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fwav_companion.mavlink.wire.definitions import DEFINITIONS
from fwav_companion.mavlink.wire.scanner import Scanner

SENDERS = ((1, 1), (1, 191), (1, 100), (255, 190), (2, 1), (1, 154), (0, 0), (42, 1))
"""The autopilot's ids, our two components', a station's, another vehicle's, a gimbal's, nobody's, a stranger's."""
PHASES = {"before": 0, "flying": 5000, "lost": 5000}
"""Milliseconds of flight before the attack; in ``lost`` the autopilot is silent through it."""
MOVED_BY_THE_VEHICLE = ("autopilot", "autopilot_lost", "adopted_s", "clock", "origin", "parameters", "telemetry")
PAYLOAD = '[[link]]\nname = "payload"\nurl = "udpin://127.0.0.1:14560"\nrole = "payload"\n'
ACCEPTING = LINKS + '[signing]\nkey_file = "signing.key"\naccept_unsigned = ["autopilot"]\n'


def version_1(msgid: int, crc_extra: int, payload: bytes, *, sender: tuple[int, int], seq: int) -> bytes:
    """A MAVLink 1 frame with a right checksum."""
    header = bytes((len(payload), seq & 255, *sender, msgid))
    return b"\xfe" + header + payload + mcrf4xx(header + payload + bytes((crc_extra,))).to_bytes(2, "little")


def forged(draw: random.Random) -> Iterator[bytes]:
    """Every message of the dialect from every sender in both versions, with a drawn or an extreme payload."""
    for number, message in enumerate(dialect.mavlink_map.values()):
        length = struct.calcsize(message.unpacker.format)
        for at, sender in enumerate(SENDERS):
            payload = draw.choice((draw.randbytes(length), bytes(length), b"\xff" * length, b"\x7f" * length))
            seq = number * len(SENDERS) + at
            body = payload.rstrip(b"\0") or b"\0"
            yield framed(message.id, message.crc_extra, body, sender=sender, seq=seq)
            if message.id < 256 and message.id in DEFINITIONS:
                short = payload[: DEFINITIONS[message.id].base_length]
                yield version_1(message.id, message.crc_extra, short, sender=sender, seq=seq)


def vehicle_state(daemon: Daemon) -> dict[str, object]:
    """The part of the status that only the vehicle's own link may move."""
    status = msgspec.to_builtins(daemon.pipeline.status(daemon.now))
    return {name: status[name] for name in MOVED_BY_THE_VEHICLE}


def attack(link: str, phase: str, seed: int) -> tuple[int, Daemon, Daemon]:
    """(number of frames, the attacked daemon, the other one) after an attack of one link."""
    attacked, calm = Daemon(PAYLOAD + LINKS), Daemon(PAYLOAD + LINKS)
    for daemon in (attacked, calm):
        if PHASES[phase]:
            daemon.fly(PHASES[phase])
    frames = list(forged(random.Random(seed)))
    for at in range(0, len(frames), 40):
        for frame in frames[at : at + 40]:
            attacked.receive(link, frame)
        for daemon in (attacked, calm):
            if phase == "flying":
                daemon.fly(20)
            else:
                daemon.advance(20)
    return len(frames), attacked, calm


@pytest.mark.slow
def test_no_forged_frame_on_a_stations_link_moves_the_vehicles_state_or_stops_the_service():
    count = 0
    for seed in range(2):
        for phase in PHASES:
            number, attacked, calm = attack("ground", phase, seed)
            count += number
            assert vehicle_state(attacked) == vehicle_state(calm), phase
            sent = attacked.sent
            attacked.fly(1100)
            assert attacked.sent > sent, "it is silent"
    assert count >= 23_000


@pytest.mark.slow
@pytest.mark.parametrize("phase", PHASES)
def test_forged_frames_on_a_payloads_link_never_count_as_the_autopilots(phase):
    """A payload is believed for its own components, of which the status names a gimbal."""
    number, attacked, calm = attack("payload", phase, 11)
    assert number >= 3_900
    state = vehicle_state(attacked)
    assert state.pop("telemetry") | {"gimbal_unused": None} == vehicle_state(calm)["telemetry"]
    assert state == {name: each for name, each in vehicle_state(calm).items() if name != "telemetry"}
    sent = attacked.sent
    attacked.fly(1100)
    assert attacked.sent > sent


@pytest.mark.slow
@pytest.mark.parametrize("phase", PHASES)
def test_forged_frames_on_the_vehicles_link_leave_the_service_running(phase):
    """Who can write to that wire can mislead, but not stop us: its autopilot is heard again afterwards."""
    number, attacked, _ = attack("autopilot", phase, 7)
    assert number >= 3_900
    sent = attacked.sent
    attacked.fly(1100)
    assert attacked.sent > sent
    assert len(msgspec.json.encode(attacked.pipeline.status(attacked.now))) < 64_000


@pytest.mark.slow
def test_with_a_key_nothing_unsigned_reaches_the_vehicle_from_a_stations_link():
    daemon = Daemon(ACCEPTING, KEY)
    daemon.fly()
    before = vehicle_state(daemon)
    passed: set[int] = set()
    for frame in forged(random.Random(3)):
        received = daemon.node.receive("ground", frame, daemon.now)
        to_vehicle = b"".join(data for to, data in received.forwards if to == "autopilot")
        passed |= {each.msgid for each in Scanner(datagrams=True).feed(to_vehicle)} if to_vehicle else set()
        for message in received.messages:
            daemon.pipeline.on_message(message, daemon.now)
    daemon.flush()
    assert passed <= RADIO
    assert vehicle_state(daemon) == before
