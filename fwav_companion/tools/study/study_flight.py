"""The record of a drawn flight that the mock flies and the service's pipeline replays. PURE but for the mock.

``record_of`` is a pure function of a draw and a flown recording.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import sqrt
from typing import Any

from fwav_companion.camera import Calibration
from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.ellipses import semi_axes
from fwav_companion.pipeline.pipeline_factory import own_components
from fwav_companion.recording.error_statistics import CHI2_95, ErrorSample
from fwav_companion.recording.line_types import CalibrationLine, HeaderLine, Line, OriginLine, TargetLine
from fwav_companion.recording.summary_types import SummaryLine
from fwav_companion.recording.truth import Truth, TruthPoint, parse_truth
from fwav_companion.recording.truth_errors import ErrorTally, error_sample
from fwav_companion.replay import read_recording, replay
from fwav_companion.tools.study.flight_draw import FlightDraw, draw_flight
from fwav_companion.tools.study.flight_record import DRAWN, POINTS, FlightRecord
from fwav_companion.tools.study.mock_process import FlownFlight
from fwav_companion.tools.study.study_plan import StudyPlan

FEW_PICTURES = 3
"""Fewest frames with a target that can be confirmed."""


def fly_one(plan: StudyPlan, index: int, arm: str, fly: Callable[[dict[str, Any]], FlownFlight]) -> FlightRecord:
    """The record of one flight of a study; ``fly`` is the mock's."""
    draw = draw_flight(plan, index, arm)
    return record_of(draw, plan, fly(draw.request))


def record_of(draw: FlightDraw, plan: StudyPlan, flown: FlownFlight) -> FlightRecord:
    """The record of a flown flight."""
    claim = draw.claim
    recording = read_recording(flown.telemetry, flown.detections, own_components(claim), claim.vehicle.system_id)
    truth = parse_truth(flown.truth, "truth.csv")
    answer = FlightAnswer(truth, start_s(flown), plan.seconds)
    for line in replay(recording, claim, Calibration(plan.lens.lens), limits=True):
        answer.add(line)
    return answer.record(draw, flown)


def start_s(flown: FlownFlight) -> float:
    """Begin of the recording, Unix seconds: the first record of a .tlog is its time in microseconds."""
    return int.from_bytes(flown.telemetry[:8], "big") / 1e6


class FlightAnswer:
    """Collects the output of a replay about one true target, line by line."""

    def __init__(self, truth: Sequence[TruthPoint], begun_s: float, seconds: float) -> None:
        self._tally, self._truth = ErrorTally(truth), Truth(truth)
        self._start_s, self._step_s = begun_s, seconds / POINTS
        self._plane: TangentPlane | None = None
        self._tracks: dict[int, list[tuple[float, ErrorSample, float, float, float]]] = {}
        self._calibrated_s: float | None = None
        self._calibration = self._calibration_lacks = ""
        self._summary: SummaryLine | None = None

    def add(self, line: Line) -> None:
        """Process the next line of a targets file."""
        self._tally.add(line)
        match line:
            case HeaderLine(origin=origin) | OriginLine(origin=origin) if origin is not None:
                self._plane = origin.plane
            case TargetLine() if line.is_confirmed:
                self._add_target(line)
            case CalibrationLine():
                self._calibration, self._calibration_lacks = line.status, line.reason or ""
                if self._calibrated_s is None and line.status == "calibrated":
                    self._calibrated_s = line.time_unix - self._start_s
            case SummaryLine():
                self._summary = line

    def _add_target(self, line: TargetLine) -> None:
        true_ned = self._truth.ned_at(line.time_unix, self._plane)
        if true_ned is None:
            return
        claimed95_m = sqrt(CHI2_95) * semi_axes(line.cov)[0]
        north, east = line.north - true_ned[0], line.east - true_ned[1]
        sample = (line.time_unix - self._start_s, error_sample(true_ned, line), claimed95_m, north, east)
        self._tracks.setdefault(line.track, []).append(sample)

    def record(self, draw: FlightDraw, flown: FlownFlight) -> FlightRecord:
        """The record; the target's track is the one that the summary assigned to it."""
        (target,), ghosts = self._tally.targets()
        summary = self._summary
        if summary is None:
            raise ValueError("the lines have no summary")
        common: dict[str, Any] = {
            "index": draw.index,
            "arm": draw.arm,
            "varied": draw.varied,
            "flown": draw.flown,
            "drawn": _drawn(flown.biases),
            "state": target.state,
            "calibrated_s": self._calibrated_s,
            "calibration": self._calibration,
            "calibration_lacks": self._calibration_lacks,
            "ghosts": ghosts,
            "frames": flown.frames,
            "in_view": flown.in_view,
            "fixes": summary.fixes,
        }
        if target.track is None:
            return FlightRecord(**common, no_answer=_why(summary, flown))
        series = self._tracks[target.track]
        _, sample, claimed95_m, north, east = series[-1]
        limits = (summary.limits or {}).get(target.track, {})
        return FlightRecord(
            **common,
            no_answer="",
            error_m=sample.error_m,
            north_error_m=north,
            east_error_m=east,
            claimed95_m=claimed95_m,
            normalised2=sample.normalised2,
            errors_m=self._at_points((at, each.error_m) for at, each, *_ in series),
            claims95_m=self._at_points((at, radius) for at, _, radius, *_ in series),
            squares=self._at_points((at, each.normalised2) for at, each, *_ in series),
            limits_m={cause: sqrt(max(0.0, variance)) for cause, variance in limits.items()},
        )

    def _at_points(self, values: Iterable[tuple[float, float]]) -> list[float | None]:
        """The latest value at or before each instant of POINTS; None before the first."""
        found: list[float | None] = []
        latest: float | None = None
        for at_s, value in values:
            while len(found) < POINTS and at_s > (len(found) + 1) * self._step_s:
                found.append(latest)
            latest = value
        return found + [latest] * (POINTS - len(found))


def _drawn(biases: dict[str, Any]) -> dict[str, float]:
    """The mock's drawn errors by the names of DRAWN."""
    (mount, lever) = biases["mount_deg"], biases["lever_arm_m"]
    spread = {
        **{f"mount_{axis}_deg": value for axis, value in zip("xyz", mount, strict=True)},
        **{f"lever_{axis}_m": value for axis, value in zip("xyz", lever, strict=True)},
    }
    return {name: spread[name] if name in spread else biases[name] for name in DRAWN}


def _why(summary: SummaryLine, flown: FlownFlight) -> str:
    """The most likely reason why there is no answer, as a name.

    A reason that dropped most of the pictures or detections; those of the first seconds, before the clock is known, are
    in every flight.
    """
    if flown.in_view < FEW_PICTURES:
        return "never_in_view"
    frames, detections = summary.dropped_frames, summary.dropped_detections
    for dropped, kept in ((frames, flown.frames - sum(frames.values())), (detections, summary.fixes)):
        if sum(dropped.values()) > kept:
            return max(sorted(dropped), key=lambda reason: dropped[reason])
    return "not_confirmed"
