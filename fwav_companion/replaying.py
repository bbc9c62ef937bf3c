"""A recording through the same pipeline that flew, as fast as it goes. Pure: file contents in, lines out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from heapq import merge

import msgspec

from fwav_companion.camera import Calibration
from fwav_companion.config import Config
from fwav_companion.geometry.stamps import NS_PER_US, HostNs
from fwav_companion.localization import ElevationTile
from fwav_companion.mavlink.codec import decode
from fwav_companion.mavlink.scanner import Scanner
from fwav_companion.nouns import Frame, Message, NoFrame, StampClock
from fwav_companion.pipeline import Pipeline
from fwav_companion.recording.lines import Line
from fwav_companion.recording.tlog import SkippedBytes, read_tlog
from fwav_companion.recording.truth import ErrorTally, TruthPoint
from fwav_companion.vision.wall_clock import RecordingClock
from fwav_companion.vision.wire import parse_frame
from fwav_companion.wiring import WANTED, make_pipeline, own_components


class Recording(msgspec.Struct, frozen=True):
    """A flight as it was recorded, on the clock of its telemetry's stamps."""

    messages: Sequence[tuple[int, Message]]
    """(Unix microseconds, message), in file order with times that never go back."""
    frames: Sequence[Frame | NoFrame]
    unix_offset_ns: int
    """Unix minus host, by the recording's own TIMESYNC requests; 0 where there are none: host time is Unix time."""
    skipped: Sequence[SkippedBytes]
    """Damaged stretches of the telemetry."""


def read_recording(telemetry: bytes, detections: bytes, own: frozenset[int]) -> Recording:
    """``own``: our component ids, whose TIMESYNC requests tell the host's clock."""
    messages: list[tuple[int, Message]] = []
    skipped: list[SkippedBytes] = []
    scanner, latest_us = Scanner(datagrams=True), 0
    for item in read_tlog(telemetry):
        if isinstance(item, SkippedBytes):
            skipped.append(item)
            continue
        latest_us = max(latest_us, item.unix_us)
        messages.extend((latest_us, message) for message in _decoded(scanner, item.frame))
    unix_offset_ns = _unix_offset_ns(messages, own)
    clock = RecordingClock(unix_offset_ns)
    lines = (line for line in detections.splitlines() if line.strip())
    return Recording(messages, [parse_frame(line, None, clock) for line in lines], unix_offset_ns, skipped)


def replay(
    recording: Recording,
    config: Config,
    calibration: Calibration,
    *,
    elevation: Sequence[ElevationTile] = (),
    sightings: bool = False,
    truth: Sequence[TruthPoint] = (),
) -> Iterator[Line]:
    """The lines of a targets file, header first, summary last. With truth the summary has ``errors``."""
    pipeline = make_pipeline(
        config,
        calibration,
        unix_offset_ns=recording.unix_offset_ns,
        live=False,
        elevation=elevation,
        sightings=sightings,
    )
    tally = ErrorTally(truth) if truth else None
    for _ in _drive(pipeline, recording, own_components(config)):
        for line in pipeline.take().lines:
            if tally is not None:
                tally.add(line)
                if line["type"] == "summary":
                    yield {**line, "errors": tally.summary()}
                    continue
            yield line


def _decoded(scanner: Scanner, data: bytes) -> Iterator[Message]:
    for frame in scanner.feed(data):
        if frame.definition is not None and frame.definition.name in WANTED:
            yield decode(frame)


def _unix_offset_ns(messages: Sequence[tuple[int, Message]], own: frozenset[int]) -> int:
    """Our requests carry the host's clock in whole microseconds, and below them a nonce."""
    for unix_us, message in messages:
        if message.name == "TIMESYNC" and message.component in own and message.fields.tc1 == 0:
            host_us: int = message.fields.ts1 // NS_PER_US
            return (unix_us - host_us) * NS_PER_US
    return 0


def _drive(pipeline: Pipeline, recording: Recording, own: frozenset[int]) -> Iterator[None]:
    """Every event at its time, telemetry before frames where times are equal; yields after each."""
    untold: list[Frame] = []
    now = HostNs(0)
    for now, _, event in merge(_messages(recording), _frames(recording, pipeline, untold), key=_by_time):
        for frame in _arrived(untold, pipeline, now):
            pipeline.on_frame(frame, now)
        if isinstance(event, Message):
            on_message = pipeline.on_own_message if event.component in own else pipeline.on_message
            on_message(event, now)
        else:
            pipeline.on_frame(event, now)
        yield
    for frame in untold:
        pipeline.on_frame(frame, now)
    pipeline.finish(now)
    yield


_Event = tuple[HostNs, int, Message | Frame | NoFrame]


def _by_time(event: _Event) -> tuple[HostNs, int]:
    return event[0], event[1]


def _messages(recording: Recording) -> Iterator[_Event]:
    for unix_us, message in recording.messages:
        yield HostNs(unix_us * NS_PER_US - recording.unix_offset_ns), 0, message


def _frames(recording: Recording, pipeline: Pipeline, untold: list[Frame]) -> Iterator[_Event]:
    """Frames by arrival. Those on the autopilot's clock that do not tell theirs are left in ``untold``."""
    events: list[_Event] = []
    last_ns = HostNs(0)
    for frame in recording.frames:
        if isinstance(frame, NoFrame):
            events.append((last_ns, 1, frame))
            continue
        if frame.arrival_ns is None and frame.stamp_clock is StampClock.BOOT:
            untold.append(frame)
            continue
        arrival_ns = frame.arrival_ns if frame.arrival_ns is not None else pipeline.arrival_untold(frame)
        if arrival_ns is not None:
            last_ns = arrival_ns
            events.append((arrival_ns, 1, frame))
    return iter(sorted(events, key=_by_time))


def _arrived(untold: list[Frame], pipeline: Pipeline, now: HostNs) -> Iterator[Frame]:
    """Take out the frames whose last row had been captured by now."""
    while untold:
        arrival_ns = pipeline.arrival_untold(untold[0])
        if arrival_ns is None or arrival_ns > now:
            return
        yield untold.pop(0)
