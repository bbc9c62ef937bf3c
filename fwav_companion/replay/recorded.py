"""Joins telemetry and detections (JSON lines) of a recorded flight on one clock. PURE.

A line that is not a frame is skipped and reported with its position.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, NS_PER_US
from fwav_companion.mavlink.wire import enums
from fwav_companion.recording.events import BeganWith, RecordingEnd, Refused, parse_event
from fwav_companion.recording.tlog import SkippedBytes
from fwav_companion.replay.telemetry import TelemetryRead, Timed, read_telemetry
from fwav_companion.self_calibration import KeptCalibration
from fwav_companion.types import Frame, Message, NoFrame, Reason, StampClock
from fwav_companion.vision.wall_clock import RecordingClock
from fwav_companion.vision.wire import parse_frame

LEAST_UNIX_NS = 10**18
"""Least Unix time: 2001-09-09. As a time since boot it would be 31 years."""
LAST_UNIX_S = 253_402_300_799
"""End of the year 9999, the last year of a date in Python."""
MOST_APART_NS = NS_PER_S
"""Time before the first message and after the last in which a frame may still be paired: the longest interpolation, and
the part that a buffered recording lacks at its end."""
FEW_DETECTIONS = 10
"""Number of detections that may all lie in the first pixel by chance: an object in the corner of the image."""


class SkippedLine(msgspec.Struct, frozen=True):
    """A line of the detections that is not a frame."""

    number: int
    """Line number, from 1."""
    offset: int
    """Offset of its first byte in the file."""
    why: str


class Recording(msgspec.Struct, frozen=True):
    """A recorded flight, on the clock of its telemetry's timestamps."""

    messages: Sequence[Timed]
    """Messages in file order, with times that never decrease."""
    frames: Sequence[Frame | NoFrame | Refused | RecordingEnd]
    """The lines of the detections, in file order."""
    unix_offset_ns: int
    """Unix minus host time from the companion's recorded TIMESYNC requests, ns; 0 without any: host time is then Unix
    time."""
    own_system: int | None
    """System id of the recording companion; None if unknown."""
    kept: KeptCalibration | None = None
    """Self-calibration of an earlier flight from which the recorded service started."""
    skipped: Sequence[SkippedBytes] = ()
    """Damaged stretches of the telemetry."""
    skipped_lines: Sequence[SkippedLine] = ()
    """Lines of the detections that are not frames."""
    notes: Sequence[str] = ()
    """Warnings to the user about the telemetry."""
    detection_notes: Sequence[str] = ()
    """Warnings to the user about the detections."""
    exact_stamps: bool = False
    """Whether attitudes are stamped at sampling, not at transmission."""
    clock_rate: float = 1.0
    """Rate of the autopilot's clock, from the telemetry."""


def read_recording(telemetry: bytes, detections: bytes, own: frozenset[int], system: int = 0) -> Recording:
    """A recording from a .tlog's content. ``own``: component ids whose TIMESYNC requests carry the host clock.

    ``system``: the configured system id; 0 takes that of the first autopilot, which the service would have adopted.
    """
    return join(read_telemetry(telemetry), detections, own, system)


def join(telemetry: TelemetryRead, detections: bytes, own: frozenset[int], system: int = 0) -> Recording:
    """Telemetry and detections as one flight."""
    of_log = _first_autopilot(telemetry.messages) if telemetry.exact_stamps else None
    own_system = of_log or system or _first_autopilot(telemetry.messages)
    unix_offset_ns = _unix_offset_ns(telemetry.messages, own, own_system)
    clock = RecordingClock(unix_offset_ns, boot_is_unix=_boot_is_unix(telemetry.messages))
    frames, kept, skipped_lines = read_frames(detections, clock)
    if telemetry.exact_stamps:
        frames = _by_boot_time_alone(frames)
    return Recording(
        messages=telemetry.messages,
        frames=frames,
        unix_offset_ns=unix_offset_ns,
        own_system=own_system,
        kept=kept,
        skipped=telemetry.skipped,
        skipped_lines=skipped_lines,
        notes=[*telemetry.notes, *_later_and_later(telemetry, unix_offset_ns)],
        detection_notes=[*_other_times(telemetry.messages, frames, unix_offset_ns), *_shares(frames)],
        exact_stamps=telemetry.exact_stamps,
        clock_rate=telemetry.clock_rate,
    )


def _later_and_later(telemetry: TelemetryRead, unix_offset_ns: int) -> list[str]:
    """A note where only arrivals show a slow clock: a queue that grows through the whole recording looks the same.

    With the companion's own TIMESYNC requests in the recording, their answers show the clock.
    """
    messages, slow = telemetry.messages, 1.0 - telemetry.clock_rate
    if slow <= 0.0 or unix_offset_ns != 0:
        return []
    late_s = slow * (messages[-1][0] - messages[0][0]) * 1e-6
    slower = f"its stamps run {1e2 * slow:.2g} % slower than its arrivals: followed as a simulator's clock"
    return [f"{slower}; on a real vehicle the link's queue grew to {late_s:.1f} s instead, and places are that late"]


def _other_times(messages: Sequence[Timed], entries: Sequence[object], unix_offset_ns: int) -> list[str]:
    """A note where most frames came at times without telemetry: they are of another flight, or of a wrong clock."""
    came_ns = [
        entry.arrival_ns if entry.arrival_ns is not None else _host_stamp_ns(entry) for entry in _frames(entries)
    ]
    unix_ns = [at_ns + unix_offset_ns for at_ns in came_ns if at_ns is not None]
    if not messages or not unix_ns:
        return []
    first_ns, last_ns = messages[0][0] * NS_PER_US, messages[-1][0] * NS_PER_US
    outside = sum(not first_ns - MOST_APART_NS <= at_ns <= last_ns + MOST_APART_NS for at_ns in unix_ns)
    if 2 * outside <= len(unix_ns):
        return []
    theirs, ours = _span(min(unix_ns), max(unix_ns)), _span(first_ns, last_ns)
    while_none = f"{outside} of {len(unix_ns)} frames came while there was no telemetry"
    return [f"{while_none}: frames from {theirs}, telemetry from {ours}"]


def _host_stamp_ns(frame: Frame) -> int | None:
    return None if frame.stamp_clock is StampClock.BOOT else frame.stamp_ns


def _span(first_ns: int, last_ns: int) -> str:
    seconds = (max(0, min(at_ns // NS_PER_S, LAST_UNIX_S)) for at_ns in (first_ns, last_ns))
    first, last = (datetime.fromtimestamp(at_s, UTC) for at_s in seconds)
    return f"{first:%Y-%m-%d %H:%M:%S} to {last:%H:%M:%S} UTC"


def _shares(entries: Sequence[object]) -> list[str]:
    """A note where every detection lies in the first pixel: some detectors give positions as shares of the image."""
    places = [(each.u, each.v) for frame in _frames(entries) for each in frame.detections]
    if len(places) < FEW_DETECTIONS or not all(0.0 <= u <= 1.0 and 0.0 <= v <= 1.0 for u, v in places):
        return []
    return ["every u and v is between 0 and 1: they look like shares of the image's size; accepted: pixels"]


def _frames(entries: Sequence[object]) -> Iterator[Frame]:
    return (entry for entry in entries if isinstance(entry, Frame))


def _by_boot_time_alone(
    entries: Sequence[Frame | NoFrame | Refused | RecordingEnd],
) -> list[Frame | NoFrame | Refused | RecordingEnd]:
    """The entries for an autopilot's own log, without the arrivals of frames that are stamped by its boot time.

    These arrivals are on another computer's wall clock, which the log may lack (no UTC) or contradict. The end of that
    computer's recording is on this clock too.
    """
    on_boot = [entry for entry in entries if isinstance(entry, Frame) and entry.stamp_clock is StampClock.BOOT]
    if not on_boot:
        return list(entries)
    replace = msgspec.structs.replace
    return [
        replace(entry, arrival_ns=None) if isinstance(entry, Frame) and entry.stamp_clock is StampClock.BOOT else entry
        for entry in entries
        if not isinstance(entry, RecordingEnd)
    ]


def read_frames(
    data: bytes, clock: RecordingClock
) -> tuple[list[Frame | NoFrame | Refused | RecordingEnd], KeptCalibration | None, list[SkippedLine]]:
    """The entries of the detections, the self-calibration at their beginning, and the lines that are not frames."""
    entries: list[Frame | NoFrame | Refused | RecordingEnd] = []
    kept: KeptCalibration | None = None
    skipped: list[SkippedLine] = []
    offset = 0
    for number, line in enumerate(data.split(b"\n"), start=1):
        if line.strip():
            entry = parse_event(line) or parse_frame(line, None, clock)
            if isinstance(entry, BeganWith):
                kept = _kept(entry) or kept
            else:
                entries.append(entry)
            if isinstance(entry, NoFrame) and entry.reason is Reason.MALFORMED:
                skipped.append(SkippedLine(number, offset, entry.detail))
        offset += len(line) + 1
    return entries, kept, skipped


def _kept(event: BeganWith) -> KeptCalibration | None:
    try:
        kept = msgspec.convert(event.calibration, KeptCalibration)
    except msgspec.ValidationError:  # from another version: the replay estimates it again
        return None
    return kept if kept.is_sound else None


def _first_autopilot(messages: Sequence[Timed]) -> int | None:
    return next(
        (
            message.system
            for _, message in messages
            if message.name == "HEARTBEAT" and message.fields.autopilot != enums.MAV_AUTOPILOT_INVALID
        ),
        None,
    )


def is_own(message: Message, own: frozenset[int], own_system: int | None) -> bool:
    """Whether the recording companion sent the message. Another vehicle's companion may have the same component id."""
    return message.component in own and own_system in (None, message.system)


def _boot_is_unix(messages: Sequence[Timed]) -> bool:
    """Whether the autopilot's clock counts from 1970 according to its TIMESYNC answers, as in PX4's simulators."""
    return any(message.name == "TIMESYNC" and message.fields.tc1 > LEAST_UNIX_NS for _, message in messages)


def _unix_offset_ns(messages: Sequence[Timed], own: frozenset[int], own_system: int | None) -> int:
    """Unix minus host time, ns, from the first TIMESYNC request: the host clock in microseconds, and a nonce below."""
    for unix_us, message in messages:
        if message.name == "TIMESYNC" and message.fields.tc1 == 0 and is_own(message, own, own_system):
            host_us: int = message.fields.ts1 // NS_PER_US
            return (unix_us - host_us) * NS_PER_US
    return 0
