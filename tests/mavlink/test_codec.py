"""Values that cannot be sent are refused with the limits; any input is decoded without a crash."""

from __future__ import annotations

import math
from struct import unpack

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mavlink_wire import Wire, unknown_frame

from fwav_companion.errors import EncodeError
from fwav_companion.mavlink.wire.codec import Encoder, decode
from fwav_companion.mavlink.wire.definitions import DEFINITIONS
from fwav_companion.mavlink.wire.frames import checksum
from fwav_companion.mavlink.wire.scanner import Scanner

HEARTBEAT = {"type": 18, "autopilot": 8, "base_mode": 0, "custom_mode": 0, "system_status": 4}
POINT = {"camera_device_id": 0, "tracking_status": 1, "tracking_mode": 1, "target_data": 4, "point_x": 0.5}
ORIENTATION = {"time_boot_ms": 1, "q1": 1.0, "q2": 0.0, "q3": 0.0, "q4": 0.0, "rollspeed": 0, "pitchspeed": 0}


@pytest.mark.parametrize(
    ("name", "fields", "said"),
    [
        ("HARTBEAT", HEARTBEAT, "no MAVLink message 'HARTBEAT'"),
        ("HEARTBEAT", HEARTBEAT | {"typ": 1}, "HEARTBEAT has no field 'typ': its fields are"),
        ("HEARTBEAT", HEARTBEAT | {"mavlink_version": 3, "typ": 1}, "has no field 'typ'"),
        ("HEARTBEAT", {"type": 18, "autopilot": 8}, "wants .*base_mode.*; only type, autopilot was given"),
        ("HEARTBEAT", {}, "only nothing was given"),
        ("HEARTBEAT", HEARTBEAT | {"type": 256}, r"HEARTBEAT.type = 256: 256 is no uint8_t"),
        ("HEARTBEAT", HEARTBEAT | {"type": -1}, r"-1 is no uint8_t"),
        ("HEARTBEAT", HEARTBEAT | {"type": 1.5}, r"1.5 is no uint8_t"),
        ("HEARTBEAT", HEARTBEAT | {"type": None}, r"None is no uint8_t"),
        ("STATUSTEXT", {"severity": 4, "text": "é" * 26}, "52 bytes, at most 50 are accepted"),
        ("STATUSTEXT", {"severity": 4, "text": b"bytes"}, r"text is accepted \(str\)"),
        ("ATTITUDE_QUATERNION", ORIENTATION | {"yawspeed": 1e39}, "is no float"),
        (
            "GPS_GLOBAL_ORIGIN",
            {"latitude": math.nan, "longitude": 0, "altitude": 0},
            "GPS_GLOBAL_ORIGIN.latitude = nan: nan is no int32_t",
        ),
        ("HOME_POSITION", {"latitude": 0, "longitude": 0, "altitude": 0, "x": 0, "y": 0, "z": 0, "q": (1, 0, 0)}
         | {"approach_x": 0, "approach_y": 0, "approach_z": 0}, r"q = \(1, 0, 0\): exactly 4 values of float"),
        ("HOME_POSITION", {"latitude": 0, "longitude": 0, "altitude": 0, "x": 0, "y": 0, "z": 0, "q": "1000"}
         | {"approach_x": 0, "approach_y": 0, "approach_z": 0}, "exactly 4 values of float"),
        ("HOME_POSITION", {"latitude": 0, "longitude": 0, "altitude": 0, "x": 0, "y": 0, "z": 0, "q": 1.0}
         | {"approach_x": 0, "approach_y": 0, "approach_z": 0}, "exactly 4 values of float"),
    ],
)  # fmt: skip
def test_what_cannot_be_sent_says_what_was_given_and_what_is_accepted(name, fields, said) -> None:
    encoder = Encoder(1, 191)
    with pytest.raises(EncodeError, match=said):
        encoder.encode(name, fields)
    assert encoder.seq == 0


def test_nan_is_a_float_like_any_other() -> None:
    (frame,) = Scanner().feed(
        Encoder(1, 191).encode("NAMED_VALUE_FLOAT", {"time_boot_ms": 1, "name": "x", "value": math.nan})
    )
    assert math.isnan(decode(frame).fields.value)


def test_zeros_are_left_out_but_never_the_first_byte() -> None:
    frame = Encoder(1, 191).encode("SYSTEM_TIME", {"time_unix_usec": 0, "time_boot_ms": 0})
    assert frame[1] == 1
    (found,) = Scanner().feed(frame)
    assert tuple(decode(found).fields) == (0, 0)


def test_text_ends_at_its_first_nul_and_is_never_a_crash() -> None:
    definition = DEFINITIONS[253]
    payload = b"\x04" + b"a\xff\0hidden".ljust(50, b"x")
    body = bytes((len(payload), 0, 0, 0, 1, 1)) + definition.id_bytes + payload
    (frame,) = Scanner().feed(b"\xfd" + body + checksum(body + definition.crc_byte).to_bytes(2, "little"))
    assert decode(frame).fields.text == "a\N{REPLACEMENT CHARACTER}"


def test_a_payload_longer_than_we_know_is_read_as_far_as_we_know() -> None:
    definition = DEFINITIONS[0]
    payload = Wire().heartbeat()[10:-2] + b"\x07\x08"
    body = bytes((len(payload), 0, 0, 0, 1, 1)) + definition.id_bytes + payload
    (frame,) = Scanner().feed(b"\xfd" + body + checksum(body + definition.crc_byte).to_bytes(2, "little"))
    assert decode(frame).fields.autopilot == 3


def test_a_signed_frame_cut_short_by_just_the_length_of_a_signature() -> None:
    """Its length is that of a complete unsigned one: only the header shows that it is signed."""
    wire = Wire()
    wire.mav.signing.secret_key = b"k" * 32
    wire.mav.signing.sign_outgoing = True
    (tiny,) = unpack("<f", b"\1\2\3\0")
    values = (7, 1.5, 2.5, tiny, 0.0, 0.0, 0.0)  # 13 zero bytes are left out, and the signature adds as many
    frame = wire.frame("ATTITUDE", *values)
    assert frame[1] == 28 - 13
    (found,) = Scanner().feed(frame)
    assert tuple(decode(found).fields) == values


def test_an_unknown_message_cannot_be_decoded() -> None:
    (frame,) = Scanner(datagrams=True).feed(unknown_frame())
    with pytest.raises(ValueError, match="11259375"):
        decode(frame)


@given(st.sampled_from(sorted(DEFINITIONS)), st.binary(min_size=1, max_size=255))
def test_any_payload_of_any_message_is_decoded(msgid, payload) -> None:
    definition = DEFINITIONS[msgid]
    body = bytes((len(payload), 0, 0, 0, 1, 1)) + definition.id_bytes + payload
    (frame,) = Scanner().feed(b"\xfd" + body + checksum(body + definition.crc_byte).to_bytes(2, "little"))
    assert len(decode(frame).fields) == len(definition.field_names)
