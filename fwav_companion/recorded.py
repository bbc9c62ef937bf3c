"""From a recording's files to what happened, in order: .tlog, ArduPilot .bin, PX4 .ulg; detections as JSON lines.

Pure but for PX4's logs, which their own library opens. What is damaged is skipped and told with its place.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec

from fwav_companion.errors import EncodeError, InputFileError
from fwav_companion.flow.wiring import WANTED
from fwav_companion.geometry.stamps import NS_PER_US
from fwav_companion.mavlink import enums
from fwav_companion.mavlink.codec import Encoder, decode
from fwav_companion.mavlink.scanner import Scanner
from fwav_companion.nouns import Frame, Message, NoFrame, Reason
from fwav_companion.recording.ardupilot_log import read_ardupilot_log
from fwav_companion.recording.dataflash import is_dataflash
from fwav_companion.recording.events import BeganWith, End, Refused, parse_event
from fwav_companion.recording.flight_log import FlightLog
from fwav_companion.recording.log_messages import messages_of
from fwav_companion.recording.one_clock import longest_stretch, on_one_clock
from fwav_companion.recording.tlog import SkippedBytes, load_tlog, read_tlog
from fwav_companion.recording.ulog import is_ulog, read_ulog
from fwav_companion.tracking import KeptCalibration
from fwav_companion.vision.wall_clock import RecordingClock
from fwav_companion.vision.wire import parse_frame

HEAD_BYTES = 256
"""Of a telemetry file: they tell its kind."""
DATAFLASH_AS_TEXT = b"FMT, 128, 89, FMT"
"""How ArduPilot's own log begins where a tool turned it into text; older ones with a line or two before."""
AUTOPILOT_SYSTEM = AUTOPILOT_COMPONENT = 1
"""As whom a log speaks: it has no MAVLink ids."""

Timed = tuple[int, Message]
"""(Unix microseconds, message)."""


class SkippedLine(msgspec.Struct, frozen=True):
    """A line of the detections that is none."""

    number: int
    """From 1."""
    offset: int
    """Of its first byte in the file."""
    why: str


class TelemetryRead(msgspec.Struct, frozen=True):
    """The telemetry of a recording."""

    messages: Sequence[Timed]
    """In file order with times that never go back."""
    skipped: Sequence[SkippedBytes] = ()
    """Damaged stretches."""
    notes: Sequence[str] = ()
    """What a user should know."""
    exact_stamps: bool = False
    """Attitudes are stamped where they are made, not where they are sent."""


class Recording(msgspec.Struct, frozen=True):
    """A flight as it was recorded, on the clock of its telemetry's stamps."""

    messages: Sequence[Timed]
    """In file order with times that never go back."""
    frames: Sequence[Frame | NoFrame | Refused | End]
    """The detections' lines, in file order."""
    unix_offset_ns: int
    """Unix minus host, by the recording's own TIMESYNC requests; 0 where there are none: host time is Unix time."""
    own_system: int | None
    """The system id that we speak with in it; None: nothing tells."""
    kept: KeptCalibration | None = None
    """What self-calibration knew from the start."""
    skipped: Sequence[SkippedBytes] = ()
    """Damaged stretches of the telemetry."""
    skipped_lines: Sequence[SkippedLine] = ()
    """Lines of the detections that are no frames."""
    notes: Sequence[str] = ()
    """What a user should know."""
    exact_stamps: bool = False
    """Attitudes are stamped where they are made, not where they are sent."""


def read_recording(telemetry: bytes, detections: bytes, own: frozenset[int], system: int = 0) -> Recording:
    """Of a .tlog's content. ``own``: our component ids, whose TIMESYNC requests tell the host's clock.

    ``system``: the configured system id; 0 takes the first autopilot's, whom we would have adopted.
    """
    return join(read_telemetry(telemetry), detections, own, system)


def load_telemetry(path: Path, own: frozenset[int]) -> TelemetryRead:
    """A telemetry file of any of the three kinds, told apart by its content. InputFileError."""
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror or error}; accepted: a .tlog, .bin or .ulg recording") from None
    if is_ulog(head):
        log, skipped, damaged = read_ulog(path)
        notes = ["some of its messages are damaged and were left out"] if damaged else []
        return _of_log(path, log, own, skipped, notes)
    if is_dataflash(head):
        log, skipped = read_ardupilot_log(path.read_bytes())
        return _of_log(path, log, own, skipped, [])
    if DATAFLASH_AS_TEXT in head:
        raise InputFileError(f"{path}: an ArduPilot log as text; accepted: the .bin that it was made from")
    return read_telemetry(load_tlog(path))


def read_telemetry(data: bytes) -> TelemetryRead:
    """Of a .tlog's content."""
    records, skipped, notes = on_one_clock(read_tlog(data))
    messages: list[Timed] = []
    scanner, latest_us = Scanner(datagrams=True), 0
    for record in records:
        latest_us = max(latest_us, record.unix_us)
        messages.extend((latest_us, message) for message in _decoded(scanner, record.frame))
    return TelemetryRead(messages, skipped, notes)


def join(telemetry: TelemetryRead, detections: bytes, own: frozenset[int], system: int = 0) -> Recording:
    """Telemetry and detections as one flight."""
    own_system = system or _first_autopilot(telemetry.messages)
    unix_offset_ns = _unix_offset_ns(telemetry.messages, own, own_system)
    frames, kept, skipped_lines = _frames(detections, RecordingClock(unix_offset_ns))
    return Recording(
        messages=telemetry.messages,
        frames=frames,
        unix_offset_ns=unix_offset_ns,
        own_system=own_system,
        kept=kept,
        skipped=telemetry.skipped,
        skipped_lines=skipped_lines,
        notes=telemetry.notes,
        exact_stamps=telemetry.exact_stamps,
    )


def _decoded(scanner: Scanner, data: bytes) -> Iterator[Message]:
    for frame in scanner.feed(data):
        if frame.definition is not None and frame.definition.name in WANTED:
            yield decode(frame)


def _of_log(
    path: Path, log: FlightLog, own: frozenset[int], skipped: Sequence[SkippedBytes], notes: Sequence[str]
) -> TelemetryRead:
    if not log.attitudes:
        raise InputFileError(
            f"{path}: no attitude in it that can be read; accepted: a log of a whole flight, with {log.attitude_source}"
            + (", as ArduPilot writes it since 2015" if log.autopilot == "ardupilot" else "")
        )
    scanner, offset_us, unfit = Scanner(datagrams=True), log.unix_minus_boot_us, 0
    ours = Encoder(AUTOPILOT_SYSTEM, max(own))
    theirs = Encoder(AUTOPILOT_SYSTEM, AUTOPILOT_COMPONENT)
    messages: list[Timed] = []
    for boot_us, name, fields in messages_of(log):
        speaker = ours if name == "TIMESYNC" and fields["tc1"] == 0 else theirs
        try:
            frame = speaker.encode(name, fields)
        except EncodeError:
            unfit += 1
            continue
        messages.extend((boot_us + offset_us, message) for message in _decoded(scanner, frame))
    start, end = longest_stretch([unix_us for unix_us, _ in messages])
    told = [*notes, *log.complaints()]
    if end - start < len(messages):
        told.append(f"{len(messages) - end + start} messages are an hour or more from the others and were left out")
    if unfit:
        told.append(f"{unfit} samples are beyond any vehicle and were left out")
    return TelemetryRead(messages[start:end], skipped, told, exact_stamps=True)


def _frames(
    data: bytes, clock: RecordingClock
) -> tuple[list[Frame | NoFrame | Refused | End], KeptCalibration | None, list[SkippedLine]]:
    entries: list[Frame | NoFrame | Refused | End] = []
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
    except msgspec.ValidationError:  # of another version: the replay learns it anew
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
    """Whether we ourselves sent it: another vehicle's companion has our component id too."""
    return message.component in own and own_system in (None, message.system)


def _unix_offset_ns(messages: Sequence[Timed], own: frozenset[int], own_system: int | None) -> int:
    """Our requests carry the host's clock in whole microseconds, and below them a nonce."""
    for unix_us, message in messages:
        if message.name == "TIMESYNC" and message.fields.tc1 == 0 and is_own(message, own, own_system):
            host_us: int = message.fields.ts1 // NS_PER_US
            return (unix_us - host_us) * NS_PER_US
    return 0
