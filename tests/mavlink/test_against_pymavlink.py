"""Every message of the dialect, byte for byte against pymavlink, both ways."""

from __future__ import annotations

import inspect
import random
from struct import pack, unpack

import pytest
from fastcrc.crc16 import mcrf4xx
from mavlink_wire import MESSAGES, Wire, parse, pymavlink_arguments, random_values
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fwav_companion.mavlink.wire import enums
from fwav_companion.mavlink.wire.codec import Encoder, decode
from fwav_companion.mavlink.wire.definitions import DEFINITIONS, definition_of
from fwav_companion.mavlink.wire.scanner import Scanner

MAVLINK_1 = [message for message in MESSAGES if message.id < 256]
IDS = [message.msgname for message in MESSAGES]


@pytest.mark.parametrize("message", MESSAGES, ids=IDS)
def test_the_checksum_seed_proves_which_fields_are_extensions(message) -> None:
    definition = DEFINITIONS[message.id]
    covered = message.msgname.encode() + b" "
    for field in definition.fields.values():
        if not field.extension:
            covered += f"{field.type} {field.name} ".encode()
            covered += bytes((field.array_length,)) if field.array_length else b""
    crc = mcrf4xx(covered)
    assert definition.crc_byte[0] == message.crc_extra == (crc & 0xFF) ^ (crc >> 8)


@pytest.mark.parametrize("message", MESSAGES, ids=IDS)
def test_encoding_is_byte_identical_and_decoding_gives_the_values_back(message) -> None:
    rng = random.Random(message.id)
    wire, encoder, scanner = Wire(7, 33), Encoder(7, 33), Scanner()
    for _ in range(4):
        values = random_values(message, rng)
        theirs = wire.pack(message(**pymavlink_arguments(values)))
        assert encoder.encode(message.msgname, values) == theirs
        (frame,) = scanner.feed(theirs)
        decoded = decode(frame, "link")
        assert (decoded.name, decoded.system, decoded.component, decoded.link) == (message.msgname, 7, 33, "link")
        assert list(decoded.fields._asdict()) == message.fieldnames
        assert _as_on_the_wire(decoded.fields._asdict(), message) == _as_on_the_wire(values, message)


def base_length(definition) -> int:
    """Length of the payload without extensions, as MAVLink 1 carries it."""
    return min((field.offset for field in definition.fields.values() if field.extension), default=definition.length)


@pytest.mark.parametrize("message", MAVLINK_1, ids=[message.msgname for message in MAVLINK_1])
def test_mavlink_1_is_read_without_its_extensions(message) -> None:
    rng = random.Random(message.id)
    values = random_values(message, rng)
    definition = DEFINITIONS[message.id]
    base = {name: value for name, value in values.items() if not definition.fields[name].extension}
    full = Wire(7, 33, version=1).pack(message(**pymavlink_arguments(base)))
    payload = full[6:-2][: base_length(definition)]  # pymavlink sends extensions in MAVLink 1 too; others do not
    body = bytes((len(payload),)) + full[2:6] + payload
    frame = b"\xfe" + body + mcrf4xx(body + definition.crc_byte).to_bytes(2, "little")
    scanner = Scanner()
    (found,) = scanner.feed(frame)
    assert (found.version, found.data, found.payload) == (1, frame, payload)
    decoded = decode(found).fields._asdict()
    expected = {name: base.get(name, field.zero) for name, field in definition.fields.items()}
    assert _as_on_the_wire(decoded, message) == _as_on_the_wire(expected, message)


def test_extensions_and_the_protocol_version_may_be_left_out() -> None:
    base = {"time_usec": 5, "target_num": 1, "frame": 12, "angle_x": 0.5, "angle_y": 0.25}
    base |= {"distance": 3.0, "size_x": 0.0, "size_y": 0.0}
    assert Encoder(1, 191).encode("LANDING_TARGET", base) == Wire(1, 191).frame("LANDING_TARGET", **base)
    heartbeat = {"type": 18, "autopilot": 8, "base_mode": 0, "custom_mode": 0, "system_status": 4}
    assert Encoder(1, 191).encode("HEARTBEAT", heartbeat) == Wire(1, 191).frame("HEARTBEAT", 18, 8, 0, 0, 4, 3)


def test_the_sequence_wraps_as_pymavlinks_does() -> None:
    wire, encoder = Wire(1, 191), Encoder(1, 191)
    heartbeat = {"type": 6, "autopilot": 8, "base_mode": 81, "custom_mode": 0, "system_status": 4}
    for _ in range(300):
        assert encoder.encode("HEARTBEAT", heartbeat) == wire.heartbeat(6, 8)


def test_pymavlink_reads_what_we_send() -> None:
    (message,) = parse(Encoder(1, 100).encode("STATUSTEXT", {"severity": 4, "text": "found: 3 m"}))
    assert message.get_type() == "STATUSTEXT"
    assert (message.text, message.get_srcSystem(), message.get_srcComponent()) == ("found: 3 m", 1, 100)


def test_every_field_lies_where_the_layout_puts_it() -> None:
    for message in MESSAGES:
        definition = definition_of(message.msgname)
        assert sum(f.width for f in definition.fields.values()) == len(
            message.unpacker.unpack(bytes(definition.length))
        )
        last = list(definition.fields.values())[-1]
        assert base_length(definition) <= definition.length
        assert last.offset < definition.length


def test_target_offsets() -> None:
    for message in MESSAGES:
        definition = DEFINITIONS[message.id]
        if "target_system" in message.fieldnames:
            payload = bytearray(definition.length)
            payload[definition.target_system_offset] = 99
            flat = dict(zip(_flat_names(message), message.unpacker.unpack(bytes(payload)), strict=True))
            assert flat["target_system"] == 99
        else:
            assert definition.target_system_offset == -1


def test_enum_values_are_those_of_the_dialect() -> None:
    ours = {name: value for name, value in vars(enums).items() if name.startswith("MAV_")}
    assert len(ours) > 20
    assert ours == {name: getattr(dialect, name) for name in ours}


def test_constructor_signatures_are_as_the_definitions_read_them() -> None:
    """If pymavlink gives a default to a field that is not an extension, this test names it."""
    for message in MESSAGES:
        with_default = [p.name for p in inspect.signature(message.__init__).parameters.values() if p.default != p.empty]
        extensions = [field.name for field in DEFINITIONS[message.id].fields.values() if field.extension]
        assert sorted(with_default) == sorted(extensions), message.msgname


def _flat_names(message) -> list[str]:
    names = []
    for name, length in zip(message.ordered_fieldnames, message.lengths, strict=True):
        kind = message.fieldtypes[message.fieldnames.index(name)]
        names += [name] * (1 if kind == "char" else length)
    return names


def _as_on_the_wire(values: dict, message) -> dict:
    """Floats rounded to the width that they have in the message."""
    kinds = dict(zip(message.fieldnames, message.fieldtypes, strict=True))
    return {name: _narrowed(value) if kinds[name] == "float" else value for name, value in values.items()}


def _narrowed(value):
    if isinstance(value, tuple):
        return tuple(_narrowed(one) for one in value)
    return unpack("<f", pack("<f", value))[0]
