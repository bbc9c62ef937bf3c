"""Frames as pymavlink packs them, for tests of our own packing, scanning and routing: a second opinion on the wire."""

from __future__ import annotations

import io
import random
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

RANGES = {
    "uint8_t": (0, 2**8 - 1),
    "int8_t": (-(2**7), 2**7 - 1),
    "uint16_t": (0, 2**16 - 1),
    "int16_t": (-(2**15), 2**15 - 1),
    "uint32_t": (0, 2**32 - 1),
    "int32_t": (-(2**31), 2**31 - 1),
    "uint64_t": (0, 2**64 - 1),
    "int64_t": (-(2**63), 2**63 - 1),
}
MESSAGES = sorted(dialect.mavlink_map.values(), key=lambda message: message.id)


class Wire:
    """One MAVLink component with its sequence counter."""

    def __init__(self, system: int = 1, component: int = 1, *, version: int = 2) -> None:
        self.mav = dialect.MAVLink(io.BytesIO(), srcSystem=system, srcComponent=component)
        self.version = version

    def frame(self, name: str, *values: Any, **fields: Any) -> bytes:
        """The next frame: the message by its name, its values by position or name."""
        message = getattr(dialect, f"MAVLink_{name.lower()}_message")(*values, **fields)
        return self.pack(message)

    def pack(self, message: Any) -> bytes:
        frame = message.pack(self.mav, force_mavlink1=self.version == 1)
        self.mav.seq = (self.mav.seq + 1) % 256
        return bytes(frame)

    def heartbeat(self, kind: int = dialect.MAV_TYPE_QUADROTOR, autopilot: int = 3) -> bytes:
        return self.frame("HEARTBEAT", kind, autopilot, 81, 0, 4, 3)

    def attitude(self, boot_ms: int = 1000) -> bytes:
        return self.frame("ATTITUDE", boot_ms, 0.1, 0.2, 0.3, 0.01, 0.02, 0.03)

    def command(self, system: int, component: int, command: int = 400) -> bytes:
        return self.frame("COMMAND_LONG", system, component, command, 0, *[1.0] * 7)


def parse(data: bytes) -> list[Any]:
    """The messages that pymavlink decodes from the bytes."""
    parser = dialect.MAVLink(io.BytesIO())
    parser.robust_parsing = True
    return parser.parse_buffer(data) or []


def random_values(message: Any, rng: random.Random) -> dict[str, Any]:
    """A value for every field, text as str, arrays as tuples; now and then all zeros, which MAVLink 2 cuts off."""
    lengths = dict(zip(message.ordered_fieldnames, message.array_lengths, strict=True))
    return {
        name: _random_value(kind, lengths[name], rng)
        for name, kind in zip(message.fieldnames, message.fieldtypes, strict=True)
    }


def pymavlink_arguments(values: dict[str, Any]) -> dict[str, Any]:
    """The values in the form of pymavlink's constructors, which take bytes for text."""
    return {name: value.encode() if isinstance(value, str) else value for name, value in values.items()}


def unknown_frame(msgid: int = 0xABCDEF, payload: bytes = b"\x01\x02\x03", *, seq: int = 0, system: int = 1) -> bytes:
    """A MAVLink 2 frame of an id that no dialect has; its checksum cannot be verified."""
    header = bytes((len(payload), 0, 0, seq, system, 1)) + msgid.to_bytes(3, "little")
    return b"\xfd" + header + payload + b"\x12\x34"


def _random_value(kind: str, length: int, rng: random.Random) -> Any:
    zero = rng.random() < 0.3
    if kind == "char":
        text = "" if zero else "".join(rng.choices("abcXYZ_09 é", k=rng.randint(0, length)))
        return text.encode()[:length].decode(errors="ignore")
    if length:
        return tuple(_random_number(kind, zero, rng) for _ in range(length))
    return _random_number(kind, zero, rng)


def _random_number(kind: str, zero: bool, rng: random.Random) -> float | int:
    if zero:
        return 0
    if kind in ("float", "double"):
        return rng.choice((rng.uniform(-1e6, 1e6), float("inf"), -0.0, 1e-30))
    return rng.randint(*RANGES[kind])
