"""Lines of the targets file in their order, and counts of frames, fixes and refusals by reason. Pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.pairing import PairedFrame, RefusedFrame
from fwav_companion.recording.line_types import HeaderLine, Line, SightingLine
from fwav_companion.recording.lines import header_line, origin_line, sighting_line, target_line, unix_seconds
from fwav_companion.recording.summary_types import NoticeObject, ShiftObject, SummaryLine
from fwav_companion.tracking import Settled
from fwav_companion.types import GroundFix, NoFix, Notice, NoticeCode, Reason, Track, TrackState
from fwav_companion.types.flight_status import LandmarkReport

MAX_HELD_LINES = 4096
"""Most lines that wait for the header. The header waits for the origin, which is decided 10 s after the first attitude
at the latest. Ten detections a frame at 30 frames/s make 3000 sightings in that time."""

SUMMARIZED = frozenset(
    {
        NoticeCode.SEVERAL_AUTOPILOTS, NoticeCode.AUTOPILOT_REPLACED, NoticeCode.AUTOPILOT_REBOOTED,
        NoticeCode.CLOCK_SLIPPED, NoticeCode.CLOCK_RATE, NoticeCode.GIMBAL_UNUSED, NoticeCode.GIMBAL_HEADING,
        NoticeCode.POSITION_JUMPED,
        NoticeCode.RELATIVE_WORLD, NoticeCode.LOCAL_WORLD, NoticeCode.POSITION_SOURCE,
        NoticeCode.READOUT_UNKNOWN, NoticeCode.PRIOR_EXCEEDED,
        NoticeCode.CALIBRATION_DROPPED,
    }
)  # fmt: skip
"""Notices that the summary repeats, because a replay has no log. They explain the state of its targets."""
QUIET_NS = NS_PER_S
"""Time between two lines of a track without news: no frame saw it, covered its place or changed its state meanwhile."""


class TargetLog:
    """Writes the lines of one targets file, and counts for its summary."""

    def __init__(self, version: str, config: Mapping[str, Any], unix_offset_ns: int, *, written: bool = True) -> None:
        """``written``: false where the lines are not used; then only counts are kept."""
        self.written = written
        """Whether lines are used; without them only counts are kept."""
        self._version = version
        self._config = config
        self._origin: Geodetic | None = None
        self._unix_offset_ns = unix_offset_ns
        self._held: list[Line] | None = []
        self.lines: list[Line] = []
        """Lines that wait for :meth:`take`."""
        self._sightings: dict[tuple[HostNs, int], list[SightingLine]] = {}
        self._last_lines: dict[int, tuple[TrackState, HostNs]] = {}
        """State and capture in the last line of each live track, by id."""
        self.frames = 0
        self.detections = 0
        self.fixes = 0
        self.terrain: ShiftObject | None = None
        """Last shift of the elevation model, for the summary."""
        self.landmarks: Callable[[], list[LandmarkReport]] = list
        """Returns the present reports of the landmarks, for the summary."""
        self._notices: dict[NoticeCode, tuple[str, int]] = {}
        """First text and count of the notices for the summary."""
        self._dropped_frames: Counter[Reason] = Counter()
        self._dropped_detections: Counter[Reason] = Counter()

    def note(self, notice: Notice) -> None:
        """Count a notice if the summary repeats it."""
        if notice.code in SUMMARIZED:
            text, count = self._notices.get(notice.code, (notice.text, 0))
            self._notices[notice.code] = (text, count + 1)

    def drop_frames(self, reason: Reason, count: int = 1) -> None:
        """Count frames that were refused as a whole."""
        self._dropped_frames[reason] += count

    def drop_detection(self, reason: Reason, count: int = 1) -> None:
        """Count refused detections of a frame that was used."""
        self._dropped_detections[reason] += count

    def count(self, paired: PairedFrame, located: Sequence[GroundFix | NoFix]) -> None:
        """Count the fixes of a frame that was used, and its refused detections."""
        for _, reason, _ in paired.refused:
            if reason is not Reason.PART_OF_PAD:  # its corners are in a fix
                self.drop_detection(reason)
        for fix in located:
            if isinstance(fix, NoFix):
                self.drop_detection(fix.reason)
            else:
                self.fixes += 1

    def refuse(self, refused: RefusedFrame, *, with_lines: bool) -> None:
        """Count a frame that was refused as a whole. ``with_lines``: and write a line for each of its detections."""
        self.drop_frames(refused.reason)
        for index in range(refused.detections if with_lines else 0):
            self.write(sighting_line(refused.number, index, sighting=None, fix=None, reason=refused.reason, gap_s=None))

    def begin(self, origin: Geodetic | None) -> None:
        """Write the header; a later origin gets a line of its own."""
        if self._held is None:
            return
        held, self._held, self._origin = self._held, None, origin
        self.lines.append(self._header())
        self.lines.extend(held)

    def origin_moved_in(self, now_ns: HostNs, origin: Geodetic) -> None:
        """Write the origin into the header, or into a line of its own where the header is already written."""
        if self._held is not None:
            self.begin(origin)
        else:
            self._origin = origin
            self.lines.append(origin_line(unix_seconds(now_ns, self._unix_offset_ns), origin))

    def write(self, line: Line) -> None:
        """Append one line."""
        if not self.written:
            return
        if self._held is None:
            self.lines.append(line)
            return
        self._held.append(line)
        if len(self._held) >= MAX_HELD_LINES:
            self.begin(None)

    def keep_sightings(self, host_ns: HostNs, frame: int, lines: list[SightingLine]) -> None:
        """Keep the sighting lines of a frame until it is settled."""
        if not self.written:
            return
        self._sightings[host_ns, frame] = lines

    def settle(self, frames: Iterable[Settled], plane: TangentPlane | None) -> None:
        """Write the sightings and targets of settled frames. ``plane``: tangent plane of their positions."""
        for frame in frames:
            for reason, count in frame.unused_fixes.items():
                self.drop_detection(reason, count)
            if not self.written:
                continue
            for line in self._sightings.pop((frame.view.host_ns, frame.view.frame), ()):
                self.write(line)
            for track in frame.tracks:
                if self._is_due(track):
                    self.write(target_line(track, plane, self._unix_offset_ns))

    def _is_due(self, track: Track) -> bool:
        """Whether a track gets a line for this frame: it was seen, looked for, changed state or was quiet for long."""
        state, written_ns = self._last_lines.get(track.id, (None, HostNs(0)))
        seen = track.last_seen_host_ns == track.host_ns
        quiet = track.state is state and not (seen or track.looked_for)
        if quiet and track.host_ns - written_ns < QUIET_NS:
            return False
        if track.state is TrackState.DROPPED:
            self._last_lines.pop(track.id, None)
        else:
            self._last_lines[track.id] = (track.state, track.host_ns)
        return True

    def take(self) -> list[Line]:
        """Lines since the last call."""
        lines, self.lines = self.lines, []
        return lines

    def refusals(self) -> dict[str, int]:
        """Counts of the refusals so far by reason, in alphabetical order."""
        return _by_name(self._dropped_frames + self._dropped_detections)

    def refused_frames(self) -> dict[str, int]:
        """Counts by reason of frames that were refused as a whole, in alphabetical order."""
        return _by_name(self._dropped_frames)

    def refused_detections(self) -> dict[str, int]:
        """Counts by reason of refused detections in frames that were used, in alphabetical order."""
        return _by_name(self._dropped_detections)

    def header(self) -> HeaderLine | None:
        """First line of a file that begins now; None before the origin is decided."""
        return None if self._held is not None else self._header()

    def _header(self) -> HeaderLine:
        return header_line(self._version, self._origin, self._unix_offset_ns, self._config)

    def summary(self) -> SummaryLine:
        """The summary, last line of the file."""
        return SummaryLine(
            frames=self.frames,
            detections=self.detections,
            fixes=self.fixes,
            dropped=self.refusals(),
            dropped_frames=self.refused_frames(),
            dropped_detections=self.refused_detections(),
            terrain=self.terrain,
            landmarks=tuple(self.landmarks()),
            notices=tuple(
                NoticeObject(code=code.value, text=text, times=times) for code, (text, times) in self._notices.items()
            ),
        )


def _by_name(counts: Counter[Reason]) -> dict[str, int]:
    return {reason.value: count for reason, count in sorted(counts.items())}


def sighting_lines(paired: PairedFrame, located: list[GroundFix | NoFix]) -> list[SightingLine]:
    """One sighting line for each detection, in the order of the frame."""
    lines: dict[int, SightingLine] = {}
    for index, reason, gap_s in paired.refused:
        lines[index] = sighting_line(paired.number, index, sighting=None, fix=None, reason=reason, gap_s=gap_s)
    for sighting, fix in zip(paired.sightings, located, strict=True):
        known, reason_or_none = (fix, None) if isinstance(fix, GroundFix) else (None, fix.reason)
        lines[sighting.index] = sighting_line(
            paired.number, sighting.index, sighting=sighting, fix=known, reason=reason_or_none, gap_s=None
        )
    return [lines[index] for index in sorted(lines)]
