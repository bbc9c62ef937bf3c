"""Event lines between the frames of a detections file, so that a replay has the same counts as the flight. PURE.

- ``{"event": "refused", "received_unix": 5.25, "reasons": {"across_clock_step": 2}}``: datagrams that were rejected
  before they became frames, at most once a second.
- ``{"event": "end", "received_unix": 61.5}``: the service stopped.
- ``{"event": "began_with", "received_unix": 0.25, "calibration": {...}}``: the self-calibration of an earlier flight.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, TypeAlias

import msgspec
from msgspec import Meta

from fwav_companion.types import Reason

UnixSeconds: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e11)]
"""Time in Unix seconds, with the same range as in detections: until the year 5138."""


class Refused(msgspec.Struct, frozen=True, tag_field="event", tag="refused"):
    """Number of rejected frames since the last such line, by reason."""

    received_unix: UnixSeconds
    reasons: dict[Reason, Annotated[int, Meta(ge=0, le=10**12)]]


class RecordingEnd(msgspec.Struct, frozen=True, tag_field="event", tag="end"):
    """The end of the recorded service."""

    received_unix: UnixSeconds


class BeganWith(msgspec.Struct, frozen=True, tag_field="event", tag="began_with"):
    """State of the self-calibration at the start."""

    received_unix: UnixSeconds
    calibration: dict[str, Any]
    """The stored JSON object of self-calibration, unchanged."""


Event: TypeAlias = Refused | RecordingEnd | BeganWith
_decoder = msgspec.json.Decoder(Event)


def refused_line(unix_us: int, reasons: Mapping[Reason, int]) -> bytes:
    """The line of a :class:`Refused`."""
    return msgspec.json.encode(Refused(unix_us / 1e6, dict(sorted(reasons.items())))) + b"\n"


def began_with_line(unix_us: int, calibration: Mapping[str, Any]) -> bytes:
    """The line of a :class:`BeganWith`."""
    return msgspec.json.encode(BeganWith(unix_us / 1e6, dict(calibration))) + b"\n"


def end_line(unix_us: int) -> bytes:
    """The line of an :class:`RecordingEnd`."""
    return msgspec.json.encode(RecordingEnd(unix_us / 1e6)) + b"\n"


def parse_event(line: bytes) -> Event | None:
    """The event in a line of a detections file; None if the line is a frame, or was not written by this program."""
    if b'"event"' not in line:
        return None
    try:
        event: Event = _decoder.decode(line)
    except (msgspec.DecodeError, UnicodeError, RecursionError):
        return None
    return event
