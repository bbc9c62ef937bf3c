"""Decodes a recording's telemetry, a .tlog or an autopilot's log (.bin, .ulg), into messages in order. PURE.

Damage is skipped and reported with its position.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import sqrt
from statistics import median

import msgspec

from fwav_companion.errors import EncodeError, InputFileError
from fwav_companion.mavlink.wire.codec import Encoder, decode
from fwav_companion.mavlink.wire.foreign_bytes import ForeignBytes
from fwav_companion.mavlink.wire.scanner import Scanner
from fwav_companion.pipeline.pipeline_factory import WANTED
from fwav_companion.recording.flight_log import FlightLog
from fwav_companion.recording.log_messages import messages_of
from fwav_companion.recording.time_checks import longest_stretch, on_one_clock
from fwav_companion.recording.tlog import SkippedBytes, read_tlog
from fwav_companion.telemetry.clock.exchange_clock import FASTEST_RATE, SLOWEST_RATE
from fwav_companion.types import Message
from fwav_companion.types.messages import ATTITUDE_MESSAGES

AUTOPILOT_SYSTEM = AUTOPILOT_COMPONENT = 1
"""Sender ids for the messages of a log, which has no MAVLink ids."""

PACE_US = 5_000_000
"""Length of a stretch whose least delayed attitude is used to measure the clock's rate, microseconds: a radio delays
messages by tenths of a second."""
LEAST_PACES = 5
"""Least number of rates between stretches of PACE_US that show the autopilot's clock and not a queue: half a minute."""
LEAST_DEPARTURE, PACE_SIGMAS = 2e-3, 4.0
"""Differences of a rate from 1, absolute and in sigmas, that it must both exceed to differ from a crystal's: three
times the range of crystals, and chance."""
MEDIAN_SIGMA = 1.858
"""One sigma of a median of Gaussians, in units of the median absolute deviation over sqrt(n): 1.4826 sqrt(pi / 2)."""

READ = WANTED | {"LANDING_TARGET"}
"""Names of the messages that are decoded: those of a flight, and what the report shows of a landing."""
Timed = tuple[int, Message]
"""(Unix microseconds, message)."""


class TelemetryRead(msgspec.Struct, frozen=True):
    """The telemetry of a recording."""

    messages: Sequence[Timed]
    """Messages in file order, with times that never decrease."""
    skipped: Sequence[SkippedBytes] = ()
    """Damaged stretches."""
    notes: Sequence[str] = ()
    """Warnings to the user."""
    exact_stamps: bool = False
    """Whether attitudes are stamped at sampling, not at transmission."""
    clock_rate: float = 1.0
    """Autopilot seconds per second of the recorder, where they differ by more than crystals do: a simulator."""


def read_telemetry(data: bytes) -> TelemetryRead:
    """The telemetry in a .tlog's content."""
    records, skipped, notes = on_one_clock(read_tlog(data))
    if not data:
        notes = [*notes, "it is empty"]
    messages: list[Timed] = []
    scanner, foreign, latest_us = Scanner(datagrams=True), ForeignBytes(), 0
    for record in records:
        latest_us = max(latest_us, record.unix_us)
        messages.extend((latest_us, message) for message in _decoded(scanner, record.frame, foreign))
    rate = _clock_rate(messages)
    if SLOWEST_RATE <= rate <= FASTEST_RATE:
        return TelemetryRead(messages, skipped, notes, clock_rate=rate)
    note = f"the autopilot's clock runs {rate:.3g} times as fast as the recorder's (a simulator?)"
    note = f"{note}: detections on another clock do not fit; accepted: time_boot"
    return TelemetryRead(messages, skipped, [*notes, note])


def _clock_rate(messages: Sequence[Timed]) -> float:
    """Rate of the autopilot's clock against the recorder's; 1 where it may be a crystal's.

    The median over pairs of consecutive stretches, each with its least delayed attitude: a reboot or a gap spoils only
    its own pair.
    """
    points = _least_delayed(messages)
    paces = [(to[1] - of[1]) * 1000 / (to[0] - of[0]) for of, to in pairwise(points)]
    paces = [pace for pace in paces if pace > 0.0]
    if len(paces) < LEAST_PACES:
        return 1.0
    rate = median(paces)
    sigma = MEDIAN_SIGMA * median([abs(pace - rate) for pace in paces]) / sqrt(len(paces))
    return rate if abs(rate - 1.0) > max(LEAST_DEPARTURE, PACE_SIGMAS * sigma) else 1.0


def _least_delayed(messages: Sequence[Timed]) -> list[tuple[int, int]]:
    """Arrival (Unix microseconds) and stamp (milliseconds) of the least delayed attitude in each PACE_US."""
    attitudes = [(unix_us, message) for unix_us, message in messages if message.name in ATTITUDE_MESSAGES]
    vehicle = attitudes[0][1].system if attitudes else 0
    points: list[tuple[int, int]] = []
    stretch = None
    for unix_us, message in attitudes:
        if message.system != vehicle:
            continue
        point = (unix_us, message.fields.time_boot_ms)
        if unix_us // PACE_US != stretch:
            stretch = unix_us // PACE_US
            points.append(point)
        elif point[0] - 1000 * point[1] < points[-1][0] - 1000 * points[-1][1]:
            points[-1] = point
    return points


def of_log(
    name: str, log: FlightLog, own: frozenset[int], skipped: Sequence[SkippedBytes], notes: Sequence[str]
) -> TelemetryRead:
    """An autopilot's own log as the messages that the autopilot would have sent. InputFileError names ``name``."""
    if not log.attitudes:
        raise InputFileError(
            f"{name}: it has no readable attitude; accepted: a log of a whole flight, with {log.attitude_source}"
            + (", as ArduPilot writes it since 2015" if log.autopilot == "ardupilot" else "")
        )
    scanner, offset_us, unfit = Scanner(datagrams=True), log.unix_minus_boot_us, 0
    ours = Encoder(AUTOPILOT_SYSTEM, max(own))
    theirs = Encoder(AUTOPILOT_SYSTEM, AUTOPILOT_COMPONENT)
    messages: list[Timed] = []
    for boot_us, kind, fields in messages_of(log):
        speaker = ours if kind == "TIMESYNC" and fields["tc1"] == 0 else theirs
        try:
            frame = speaker.encode(kind, fields)
        except EncodeError:
            unfit += 1
            continue
        messages.extend((boot_us + offset_us, message) for message in _decoded(scanner, frame, ForeignBytes()))
    start, end = longest_stretch([unix_us for unix_us, _ in messages])
    notes = [*notes, *log.complaints()]
    if end - start < len(messages):
        notes.append(f"{len(messages) - end + start} messages are an hour or more from the others and were left out")
    if unfit:
        notes.append(f"{unfit} samples have impossible values and were left out")
    return TelemetryRead(messages[start:end], skipped, notes, exact_stamps=True)


def _decoded(scanner: Scanner, data: bytes, foreign: ForeignBytes) -> Iterator[Message]:
    """The wanted messages in these bytes; ``foreign`` counts all frames."""
    for frame in scanner.feed(data):
        if frame.definition is not None and frame.definition.name in READ:
            yield decode(frame, foreign=foreign)
        foreign.add(frame.system, frame.data)
