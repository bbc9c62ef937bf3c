"""Feeds a recording to the pipeline of the service, as fast as possible. PURE: a recording in, lines out."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from heapq import merge
from itertools import islice

import msgspec

from fwav_companion.camera import Calibration
from fwav_companion.config import Config
from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, NS_PER_US, HostNs, host_from_seconds, ns_from_s
from fwav_companion.localization import ElevationTile
from fwav_companion.pipeline.pipeline import Pipeline
from fwav_companion.pipeline.pipeline_factory import make_pipeline, own_components
from fwav_companion.recording.events import RecordingEnd, Refused
from fwav_companion.recording.line_types import Line, TargetLine
from fwav_companion.recording.lines import final_places
from fwav_companion.recording.summary_types import FinalObject, SummaryLine
from fwav_companion.recording.truth import TruthPoint
from fwav_companion.recording.truth_errors import ErrorTally
from fwav_companion.replay.recorded import Recording, is_own
from fwav_companion.tracking import bias_shares
from fwav_companion.tracking.filters.base import Filter
from fwav_companion.tracking.smoothed.solve_jobs import InLineJob, SmootherOptions
from fwav_companion.types import Frame, Message, NoFrame, StampClock, TrackState
from fwav_companion.types.messages import ATTITUDE_MESSAGES

MARGIN_NS = 60 * NS_PER_S
REBOOT_MS = 1000
"""Step back of the boot time beyond which it is a reboot, ms: links reorder and clocks slip by less."""
REBOOTED_NS = 30 * NS_PER_S
"""Time after a reboot within which the new clock is known: three stamps decide the reboot and ten begin the clock, at
one stamp in 2 s, slower than any telemetry that pairs frames."""
AFTER_REBOOT = 10
"""Number of consecutive frames with earlier stamps that show a new clock: a file may have a few out of order."""
LARGE_OFFSET_S = 0.3
"""[camera] time_offset_s beyond which a frame would be refused as late by its recorded arrival, s. A replay need not
hurry, so the arrival is corrected too. Below, a replay has the same results as the flight."""


def replay(
    recording: Recording,
    config: Config,
    calibration: Calibration,
    *,
    elevation: Sequence[ElevationTile] = (),
    own_filter: Filter | None = None,
    sightings: bool = False,
    truth: Sequence[TruthPoint] = (),
    limits: bool = False,
    smooths: bool = False,
) -> Iterator[Line]:
    """The lines of a targets file, header first, summary last. With truth the summary has ``errors``.

    ``own_filter`` replaces the filter of [tracking] filter. ``limits``: the summary has, by track, the horizontal
    variance that each live target would lose if one cause of its error were known, m^2. ``smooths``: the smoother
    estimates.
    """
    pipeline = make_pipeline(
        _config_for(recording, config),
        calibration,
        unix_offset_ns=recording.unix_offset_ns,
        live=False,
        elevation=elevation,
        kept=recording.kept,
        own_filter=own_filter,
        sightings=sightings,
        clock_rate=recording.clock_rate,
        smoother=SmootherOptions(InLineJob, whole_flight=True) if smooths else None,
    )
    tally, ends = ErrorTally(truth) if truth else None, dict[int, TargetLine]()
    for _ in _drive(pipeline, recording, own_components(config)):
        if not pipeline.has_outputs:
            continue
        for line in pipeline.take().lines:
            if tally is not None:
                tally.add(line)
            if isinstance(line, TargetLine) and line.state is TrackState.CONFIRMED:
                ends[line.track] = line
            if isinstance(line, SummaryLine):
                yield msgspec.structs.replace(
                    line,
                    final=_final(pipeline, ends) if smooths else None,
                    errors=None if tally is None else tally.summary(),
                    limits=_limits(pipeline, config) if limits else None,
                )
                continue
            yield line


def _final(pipeline: Pipeline, ends: Mapping[int, TargetLine]) -> list[FinalObject]:
    """The targets by the whole flight. ``ends``: the last line of each confirmed track."""
    return final_places(pipeline.final_places(), ends, pipeline.telemetry.world.plane)


def _limits(pipeline: Pipeline, config: Config) -> dict[int, dict[str, float]]:
    return {track: bias_shares(target, config.priors) for track, target in pipeline.best_targets.items()}


def _config_for(recording: Recording, config: Config) -> Config:
    """The configuration for the replay. For an autopilot's own log, it names the log's one vehicle, without a wait for
    others.

    Attitude stamps in such a log are exact, without a delay.
    """
    if not recording.exact_stamps:
        return config
    replace = msgspec.structs.replace
    config = replace(config, vehicle=replace(config.vehicle, system_id=recording.own_system or 0))
    if config.uncertainty.attitude_stamp_delay_s != "auto":
        return config
    return replace(config, uncertainty=replace(config.uncertainty, attitude_stamp_delay_s=0.0))


def _drive(pipeline: Pipeline, recording: Recording, own: frozenset[int]) -> Iterator[None]:
    """Process each event at its time, telemetry before frames at equal times; yields after each."""
    untold = BootFrames(_reboots(recording))
    now = HostNs(0)
    for now, _, event in merge(_messages(recording), _frames(recording, pipeline, untold), key=_by_time):
        for frame in untold.arrived(pipeline, now):
            pipeline.on_frame(frame, now)
        if isinstance(event, Message):
            on_message = pipeline.on_own_message if is_own(event, own, recording.own_system) else pipeline.on_message
            on_message(event, now)
        elif isinstance(event, Refused):
            for reason, count in event.reasons.items():
                pipeline.on_refused(reason, count, now)
        elif isinstance(event, RecordingEnd):
            break
        else:
            pipeline.on_frame(event, now)
        yield
    for frame in untold.frames:  # after the log's end: each at its own time, so that not too many wait at once
        now = max(now, pipeline.assumed_arrival(frame) or now)
        pipeline.on_frame(frame, now)
    pipeline.finish(now)
    yield


class BootFrames:
    """Frames on the autopilot's clock without an arrival time, in order of their captures."""

    def __init__(self, reboots: Sequence[HostNs]) -> None:
        """``reboots``: instant of the first message of each new clock."""
        self.frames: deque[Frame] = deque()
        self._reboots = reboots
        self._last_ns = HostNs(0)

    def extend(self, frames: list[Frame]) -> None:
        """Add frames in the file's order. Without a reboot they are sorted by their stamps."""
        if not self._reboots:
            frames.sort(key=lambda frame: frame.stamp_ns)
        self.frames.extend(frames)

    def arrived(self, pipeline: Pipeline, now: HostNs) -> Iterator[Frame]:
        """Remove and yield the frames whose last row was captured by now."""
        while self.frames:
            arrival_ns = pipeline.assumed_arrival(self.frames[0])
            if arrival_ns is None or arrival_ns > now or self._is_of_the_next_clock(pipeline, now):
                return
            self._last_ns = max(arrival_ns, self._last_ns)
            yield self.frames.popleft()

    def _is_of_the_next_clock(self, pipeline: Pipeline, now: HostNs) -> bool:
        """Whether the next frame was captured after a reboot that the pipeline does not know yet: on the former clock
        the next captures all lie before those of earlier frames. A late frame would be the only one to do so.
        """
        if not any(now < at + REBOOTED_NS for at in self._reboots):
            return False
        arrivals = [pipeline.assumed_arrival(frame) for frame in islice(self.frames, AFTER_REBOOT)]
        earliest_ns = self._last_ns - REBOOT_MS * NS_PER_MS
        return all(arrival_ns is not None and arrival_ns < earliest_ns for arrival_ns in arrivals)


_Event = tuple[HostNs, int, Message | Frame | NoFrame | Refused | RecordingEnd]


def _by_time(event: _Event) -> tuple[HostNs, int]:
    return event[0], event[1]


def _messages(recording: Recording) -> Iterator[_Event]:
    for unix_us, message in recording.messages:
        yield HostNs(unix_us * NS_PER_US - recording.unix_offset_ns), 0, message


def _frames(recording: Recording, pipeline: Pipeline, untold: BootFrames) -> Iterator[_Event]:
    """Frames by arrival. Frames on the autopilot's clock without an arrival time are appended to ``untold``."""
    events: list[_Event] = []
    on_boot: list[Frame] = []
    near = _near(recording)
    last_ns = near(HostNs(0))
    for frame in _in_time(recording, pipeline.time_offset_s):
        if isinstance(frame, NoFrame):
            events.append((last_ns, 1, frame))
            continue
        if isinstance(frame, Refused | RecordingEnd):
            last_ns = near(HostNs(host_from_seconds(frame.received_unix) - recording.unix_offset_ns))
            events.append((last_ns, 1, frame))
            continue
        if frame.arrival_ns is None and frame.stamp_clock is StampClock.BOOT:
            on_boot.append(frame)
            continue
        arrival_ns = frame.arrival_ns if frame.arrival_ns is not None else pipeline.assumed_arrival(frame)
        if arrival_ns is not None:
            last_ns = near(arrival_ns)
            events.append((last_ns, 1, frame))
    untold.extend(on_boot)
    return iter(sorted(events, key=_by_time))


def _reboots(recording: Recording) -> list[HostNs]:
    """Arrival of the first attitude after each reboot. Without a reboot, frames are ordered by their stamps, else by
    their file.
    """
    reboots: list[HostNs] = []
    latest_ms: dict[int, int] = {}
    for unix_us, message in recording.messages:
        if message.name in ATTITUDE_MESSAGES:
            boot_ms: int = message.fields.time_boot_ms
            latest = latest_ms.get(message.system, 0)
            back = boot_ms < latest - REBOOT_MS
            if back:
                reboots.append(HostNs(unix_us * NS_PER_US - recording.unix_offset_ns))
            latest_ms[message.system] = boot_ms if back else max(boot_ms, latest)
    return reboots


def _in_time(recording: Recording, time_offset_s: float) -> Iterator[Frame | NoFrame | Refused | RecordingEnd]:
    """The entries of the detections. With a large offset of the stamps, arrivals are corrected by the offset too.

    Arrivals before their stamps are not corrected: the clock of these stamps is ahead, and the frames came in time.
    """
    earlier_ns = ns_from_s(time_offset_s) if time_offset_s > LARGE_OFFSET_S else 0
    for entry in recording.frames:
        if earlier_ns and isinstance(entry, Frame) and entry.arrival_ns is not None and not _is_ahead(entry):
            yield msgspec.structs.replace(entry, arrival_ns=HostNs(entry.arrival_ns - earlier_ns))
        else:
            yield entry


def _is_ahead(frame: Frame) -> bool:
    return (
        frame.arrival_ns is not None and frame.stamp_clock is not StampClock.BOOT and frame.arrival_ns < frame.stamp_ns
    )


def _near(recording: Recording) -> Callable[[HostNs], HostNs]:
    """A function that limits an instant to a minute before the telemetry and later.

    Frames before that cannot be used, whatever their time. Frames after the telemetry keep their times: they are
    refused for lack of a vehicle state as in flight, and at one instant too many of them would wait at once.
    """
    first_us = recording.messages[0][0] if recording.messages else 0
    first_ns = first_us * NS_PER_US - recording.unix_offset_ns
    return lambda at_ns: HostNs(max(first_ns - MARGIN_NS, at_ns))
