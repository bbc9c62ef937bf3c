"""Frames of a recording without their signatures, verified by pymavlink; and frames that are not recorded at all."""

import io
import random

import pytest
from mavlink_wire import Wire, parse, random_values
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.router.node import LinkPolicy, Node, SigningPolicy
from fwav_companion.mavlink.wire.frames import checksum
from fwav_companion.mavlink.wire.scanner import Scanner
from fwav_companion.mavlink.wire.strip_signature import unsigned

KEY = bytes(range(32))
MESSAGES = sorted(dialect.mavlink_map.values(), key=lambda message: message.id)


def signed_wire(system: int = 1) -> Wire:
    wire = Wire(system)
    wire.mav.signing.secret_key = KEY
    wire.mav.signing.sign_outgoing = True
    wire.mav.signing.timestamp = 10**12
    return wire


@pytest.mark.parametrize("seed", range(4))
def test_every_signed_message_becomes_the_unsigned_one(seed):
    rng = random.Random(seed)
    for message in rng.sample(MESSAGES, 60):
        values = {
            key: value.encode() if isinstance(value, str) else value
            for key, value in random_values(message, rng).items()
        }
        made = message(**values)
        mav = dialect.MAVLink(io.BytesIO(), srcSystem=9, srcComponent=8)
        mav.seq = rng.randrange(256)
        plain = bytes(made.pack(mav))
        mav.signing.secret_key, mav.signing.sign_outgoing = KEY, True
        (frame,) = Scanner(datagrams=True).feed(bytes(made.pack(mav)))
        assert frame.signed
        assert unsigned(frame) == plain


def test_a_frame_without_a_signature_stays_as_it_is():
    """A MAVLink 1 frame has its sequence number where MAVLink 2 has the flag of a signature."""
    for version in (1, 2):
        wire = Wire(version=version)
        for _ in range(3):
            (frame,) = Scanner(datagrams=True).feed(wire.attitude())
            assert unsigned(frame) == frame.data


def test_an_unknown_message_keeps_the_checksum_that_its_own_dialect_expects():
    for seed_byte in range(256):
        header = b"\x03\x01\x00\x07\x01\x01\xef\xcd\xab" + b"abc"
        signed = b"\xfd" + header + checksum(header + bytes((seed_byte,))).to_bytes(2, "little") + bytes(13)
        (frame,) = Scanner(datagrams=True).feed(signed)
        assert not frame.known
        plain = b"\x03\x00\x00\x07\x01\x01\xef\xcd\xab" + b"abc"
        assert unsigned(frame) == b"\xfd" + plain + checksum(plain + bytes((seed_byte,))).to_bytes(2, "little")


def test_an_unsigned_frame_is_kept_as_it_is():
    (frame,) = Scanner(datagrams=True).feed(Wire().attitude())
    assert unsigned(frame) is frame.data


def names(frames):
    return [message.get_type() for frame in frames for message in parse(frame.data)]


def test_what_the_flight_did_not_take_is_not_for_a_recording():
    links = [
        LinkPolicy(name=name, role="autopilot", max_rate_hz={}, forward_rate_requests=True, datagrams=True)
        for name in ("one", "two")
    ]
    node = Node(links, ["HEARTBEAT", "ATTITUDE"], signing=SigningPolicy(key=KEY, timestamp=0))
    genuine, forger, now = signed_wire(), Wire(), HostNs(1_000_000)
    first = node.receive("one", genuine.heartbeat(), now)
    assert names(first.frames) == ["HEARTBEAT"]
    assert names(node.receive("one", forger.attitude(), now).frames) == []
    copied = genuine.attitude()
    assert names(node.receive("one", copied, now).frames) == ["ATTITUDE"]
    assert names(node.receive("two", copied, now).frames) == []
    key_setup = genuine.frame("SETUP_SIGNING", 1, 1, list(KEY), 5)
    received = node.receive("one", genuine.heartbeat() + key_setup + genuine.heartbeat(), now)
    assert names(received.frames) == ["HEARTBEAT", "HEARTBEAT"]
    assert KEY not in b"".join(frame.data for frame in node.receive("two", key_setup, now).frames)


def test_an_echo_of_ours_is_not_for_a_recording():
    node = Node(
        [LinkPolicy(name="one", role="autopilot", max_rate_hz={}, forward_rate_requests=True, datagrams=True)],
        ["TIMESYNC"],
    )
    node.adopt(1)
    ours = Wire(1, 191).frame("TIMESYNC", 0, 5)
    assert node.receive("one", ours, HostNs(1000)).frames == []
