"""What happened at the door, as lines between the frames of a detections file: a replay counts as the flight did. Pure.

``{"event": "refused", "received_unix": 5.25, "reasons": {"across_clock_step": 2}}`` tells, at most once a second, how
many frames were refused before they were any; ``{"event": "end", "received_unix": 61.5}`` when the service stopped;
``{"event": "began_with", "received_unix": 0.25, "calibration": {...}}`` what an earlier flight had left to this one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, TypeAlias

import msgspec
from msgspec import Meta

from fwav_companion.types import Reason

UnixSeconds: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e11)]
"""As detections have it: until the year 5138."""


class Refused(msgspec.Struct, frozen=True, tag_field="event", tag="refused"):
    """So many frames were refused since the last such line."""

    received_unix: UnixSeconds
    reasons: dict[Reason, Annotated[int, Meta(ge=0, le=10**12)]]


class RecordingEnd(msgspec.Struct, frozen=True, tag_field="event", tag="end"):
    """The flight was over then."""

    received_unix: UnixSeconds


class BeganWith(msgspec.Struct, frozen=True, tag_field="event", tag="began_with"):
    """What self-calibration knew from the start."""

    received_unix: UnixSeconds
    calibration: dict[str, Any]
    """Its owner's, as it was kept."""


Event: TypeAlias = Refused | RecordingEnd | BeganWith
_decoder = msgspec.json.Decoder(Event)


def refused_line(unix_us: int, reasons: Mapping[Reason, int]) -> bytes:
    """One line."""
    return msgspec.json.encode(Refused(unix_us / 1e6, dict(sorted(reasons.items())))) + b"\n"


def began_with_line(unix_us: int, calibration: Mapping[str, Any]) -> bytes:
    """One line."""
    return msgspec.json.encode(BeganWith(unix_us / 1e6, dict(calibration))) + b"\n"


def end_line(unix_us: int) -> bytes:
    """One line."""
    return msgspec.json.encode(RecordingEnd(unix_us / 1e6)) + b"\n"


def parse_event(line: bytes) -> Event | None:
    """The event in a line of a detections file; None where it is a frame, or nothing that we wrote."""
    if b'"event"' not in line:
        return None
    try:
        event: Event = _decoder.decode(line)
    except (msgspec.DecodeError, UnicodeError, RecursionError):
        return None
    return event
