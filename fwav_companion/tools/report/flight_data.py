"""The data of one flight that a report draws: targets, path, error budget, clock, calibration and counts. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import Any

import msgspec

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.ellipses import NORMAL_95
from fwav_companion.recording.labels import landmark_result, notice_texts, shift_text
from fwav_companion.recording.line_types import (
    CalibrationLine,
    ClockEstimateLine,
    HeaderLine,
    Line,
    OriginLine,
    SightingLine,
    TargetLine,
    header_of,
    line_unix_s,
)
from fwav_companion.recording.summary_types import SummaryLine
from fwav_companion.recording.truth import TruthPoint
from fwav_companion.tools.report.final_section import FinalTarget, final_targets
from fwav_companion.tools.report.landing_record import LandingRecord, RecordedMessages, landing_record
from fwav_companion.tools.report.series_builder import target_series
from fwav_companion.tools.report.sighting_statistics import (
    budget95_m,
    estimated_path,
    height_m,
    refused_detections,
    refused_frames,
)
from fwav_companion.tools.report.target_series import ReplayedLines, TargetSeries
from fwav_companion.tools.report.tracking_variants import PLAIN, TrackingVariant
from fwav_companion.tools.report.true_vehicle_path import (
    HorizontalError,
    TrueVehiclePath,
    mean_position_error,
    position_errors,
)
from fwav_companion.tools.report.used_config import UsedLandmark, used_config
from fwav_companion.types.flight_status import ParameterReport

CUT_OFF = SummaryLine(frames=0, detections=0, fixes=0, dropped={})
"""Summary of a recording that has none: it was cut off."""


TIMED = (TargetLine, ClockEstimateLine, CalibrationLine)
"""Lines that span a flight."""


class ClockSample(msgspec.Struct, frozen=True):
    """Uncertainty of the offset between the autopilot's clock and the host clock."""

    at_s: float
    error95_s: float
    """Half width of the 95 % interval, seconds; at most the hard bound."""
    bound_s: float
    """Hard bound, seconds."""


class CalibrationSample(msgspec.Struct, frozen=True):
    """The state of self-calibration at one time."""

    at_s: float
    time_offset_s: float
    time_offset_sigma_s: float
    mount_deg: Sequence[float]
    """Mount correction, a rotation vector about the body axes x, y, z, degrees."""
    mount_sigma_deg: Sequence[float]
    status: str
    mistake: str
    """A gross mistake of the mount; empty if none was found."""
    parameters: Sequence[ParameterReport] = ()
    """Status of each parameter, where the smoother estimated."""


class PlantedErrors(msgspec.Struct, frozen=True):
    """True camera errors of a mock flight, unknown to the service."""

    time_offset_s: float
    mount_deg: Sequence[float]


class CameraPicture(msgspec.Struct, frozen=True):
    """One picture of the camera and the detections in it."""

    jpeg: bytes
    size: tuple[int, int]
    frame: int
    detections: Sequence[Mapping[str, Any]]
    """Detections in the wire format."""


class LandmarkSeries(msgspec.Struct, frozen=True):
    """One landmark of the configuration, and the use of its measurements."""

    label: str
    north: float
    """Known place, metres from the origin."""
    east: float
    sigma_m: float
    used: int
    """Number of measurements that were used."""
    refused: int
    result: str
    """Result in words."""
    left_out: bool


class FlightData(msgspec.Struct, frozen=True, kw_only=True):
    """One flight."""

    title: str
    start_unix: float
    """Unix time of the first line, seconds; times in this structure count from it."""
    seconds: float
    """Time from the first line to the last."""
    version: str
    origin: Geodetic | None
    has_altitude: bool
    """Whether the origin's altitude above the sea is known; with poses above the take-off it is not."""
    targets: list[TargetSeries]
    variant: TrackingVariant
    """The variant that made the estimates."""
    path: list[list[tuple[float, float]]]
    """Parts of the vehicle's path, north and east, metres: the true path where it is known, else the estimated one."""
    path_is_true: bool
    gaps_s: list[float]
    """Time from each used detection to the nearest attitude, seconds."""
    height_m: float | None
    """Median height of the camera above the ground at the used sightings, metres; None without a position."""
    position_error_m: HorizontalError | None
    """Mean error of the vehicle's position at the used sightings, metres: it is common to all targets. None where the
    truth is not known."""
    budget95_m: dict[str, float]
    """Radius that holds 95 % of one sighting's errors from each cause, metres."""
    clock: list[ClockSample]
    frames: int
    detections: int
    fixes: int
    """Detections that were placed on the ground."""
    refused_frames: dict[str, int]
    """Number of whole frames that were refused, by reason."""
    refused_detections: dict[str, int]
    """Number of detections, in frames that were not refused, that were not placed on the ground, by reason."""
    picture: CameraPicture | None
    hidden: dict[str, str]
    """True errors of the vehicle that the service did not know, where they are known."""
    notes: list[str]
    moving: bool
    """Whether the tracker assumed that targets move."""
    calibration: list[CalibrationSample]
    """Self-calibration of this replay, else of another variant of the same recording."""
    calibrated_by: str
    """Name of that other variant; empty: this replay."""
    planted: PlantedErrors | None
    landmarks: list[LandmarkSeries] = []
    landing: LandingRecord | None = None
    """What the recording holds of a landing; None without LANDING_TARGET."""
    final: list[FinalTarget] = []
    """Targets by the whole flight; empty where they were estimated live alone."""

    @property
    def has_truth(self) -> bool:
        """Whether the truth of any target is known."""
        return any(target.true_ned is not None for target in self.targets)

    @property
    def ghosts(self) -> int:
        """Number of confirmed tracks without a true target of their own."""
        return sum(target.ghost for target in self.targets)

    @property
    def mistake(self) -> str:
        """The last gross mistake of the mount that self-calibration named; empty without one."""
        return next((sample.mistake for sample in reversed(self.calibration) if sample.mistake), "")


def flight_data(
    lines: Sequence[Line],
    *,
    title: str,
    truth: Sequence[TruthPoint] = (),
    variant: TrackingVariant = PLAIN,
    others: Sequence[ReplayedLines] = (),
    planted: PlantedErrors | None = None,
    true_path: TrueVehiclePath | None = None,
    picture: CameraPicture | None = None,
    hidden: Mapping[str, str] | None = None,
    notes: Iterable[str] = (),
    recorded: RecordedMessages | None = None,
) -> FlightData:
    """The flight in the lines of a replay with sightings, header first; ``others``: the recording tracked in other
    variants.

    ``recorded``: the recording's messages where it may hold a landing.
    """
    header, end_line = header_of(lines), lines[-1]
    if header is None:
        raise TypeError(f"the first line is not a header: {lines[0]!r}")
    config = used_config(header.config)
    summary = end_line if isinstance(end_line, SummaryLine) else CUT_OFF
    sightings = [line for line in lines if isinstance(line, SightingLine)]
    place = next((line.origin for line in lines if isinstance(line, HeaderLine | OriginLine) and line.origin), None)
    origin, plane = (None, None) if place is None else (place.geodetic, place.plane)
    start, end = _span([*lines, *chain.from_iterable(other.lines for other in others)], header.unix_offset_s)
    used = [line for line in sightings if line.reason is None]
    errors = {} if true_path is None else position_errors(lines, true_path)
    calibration, calibrated_by = _calibration([ReplayedLines("", variant.kind, lines), *others], start)
    targets = target_series(lines, others=others, truth=truth, plane=plane, start_unix=start, position_errors=errors)
    return FlightData(
        title=title,
        start_unix=start,
        seconds=end - start,
        version=header.version,
        origin=origin,
        has_altitude=place is not None and place.alt_amsl is not None,
        targets=targets,
        variant=variant,
        path=estimated_path(used) if true_path is None else [[(n, e) for n, e, _ in true_path.positions_ned]],
        path_is_true=true_path is not None,
        gaps_s=[line.gap_s for line in used if line.gap_s is not None],
        height_m=height_m(used) if origin else None,
        position_error_m=mean_position_error(errors),
        budget95_m=budget95_m(used),
        clock=_clock(lines, header.unix_offset_s - start),
        frames=summary.frames,
        detections=summary.detections,
        fixes=summary.fixes,
        refused_frames=refused_frames(sightings, summary.dropped),
        refused_detections=refused_detections(sightings, summary.dropped),
        picture=picture,
        hidden=dict(hidden or {}),
        notes=[*notes, *_terrain_notes(summary), *map(_sentence, notice_texts(summary))],
        moving=config.tracking.motion == "moving",
        calibration=calibration,
        calibrated_by=calibrated_by,
        planted=planted,
        landing=None if recorded is None else landing_record(lines, recorded, start),
        final=final_targets(lines, targets),
        landmarks=_landmarks(config.landmark, summary, plane),
    )


def _landmarks(
    configured: Sequence[UsedLandmark], summary: SummaryLine, plane: TangentPlane | None
) -> list[LandmarkSeries]:
    """The landmarks with their results; empty without an origin."""
    shown = {each.label: each for each in summary.landmarks}
    found = []
    for landmark in configured if plane is not None else ():
        result = shown.get(landmark.label)
        if plane is None or result is None:
            continue
        place = Geodetic.from_degrees(landmark.lat, landmark.lon, landmark.alt_amsl)
        north, east, _ = plane.ned_from_geodetic(place)
        found.append(
            LandmarkSeries(
                label=landmark.label,
                north=north,
                east=east,
                sigma_m=landmark.sigma_m,
                used=result.used,
                refused=result.refused,
                result=landmark_result(result),
                left_out=result.state == "left_out",
            )
        )
    return found


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."


def _terrain_notes(summary: SummaryLine) -> list[str]:
    """The shift of the elevation model that counts at the end; empty without one."""
    return [] if summary.terrain is None else [f"Elevation model: {shift_text(summary.terrain)}."]


def _span(lines: Sequence[Line], unix_offset_s: float) -> tuple[float, float]:
    """Unix times of the first and the last line with a time."""
    found = (line_unix_s(line, unix_offset_s) for line in lines if isinstance(line, TIMED))
    times = [at_s for at_s in found if at_s is not None]
    return (min(times), max(times)) if times else (0.0, 0.0)


def _clock(lines: Sequence[Line], start_from_monotonic_s: float) -> list[ClockSample]:
    return [
        ClockSample(
            at_s=line.time_monotonic + start_from_monotonic_s,
            error95_s=min(NORMAL_95 * line.sigma_s, line.bound_s),
            bound_s=line.bound_s,
        )
        for line in lines
        if isinstance(line, ClockEstimateLine)
    ]


def _calibration(replays: Sequence[ReplayedLines], start: float) -> tuple[list[CalibrationSample], str]:
    """Self-calibration of the first replay that has it, and that replay's name."""
    for replay in replays:
        lines = [line for line in replay.lines if isinstance(line, CalibrationLine)]
        if lines:
            return [_calibration_sample(line, start) for line in lines], replay.name
    return [], ""


def _calibration_sample(line: CalibrationLine, start: float) -> CalibrationSample:
    return CalibrationSample(
        at_s=line.time_unix - start,
        time_offset_s=line.time_offset_s,
        time_offset_sigma_s=line.time_offset_sigma_s,
        mount_deg=line.mount_deg,
        mount_sigma_deg=line.mount_sigma_deg,
        status=line.status,
        mistake=line.mistake,
        parameters=line.parameters,
    )
