"""The summary, last line of a targets file, and its parts. PURE.

Fields with a plain default are absent from the file where they have that value, as in ``line_types``.
"""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.recording.error_statistics import ErrorStatistics
from fwav_companion.types.flight_status import LandmarkReport


def no_counts() -> dict[str, int]:
    """No counts, which are written nevertheless: ``omit_defaults`` would leave out an empty ``dict``."""
    return {}


class ShiftObject(msgspec.Struct, frozen=True, kw_only=True):
    """The last shift of the elevation model."""

    shift_m: float
    sigma_m: float
    """Its share in every uncertainty, metres."""
    source: str


class NoticeObject(msgspec.Struct, frozen=True, kw_only=True):
    """A notice of the flight that explains the state of its targets."""

    code: str
    text: str
    """Its first text."""
    times: int


class SharedErrorObject(msgspec.Struct, frozen=True, kw_only=True):
    """One error that all pictures share, by the sights of the confirmed targets."""

    error: str
    group: int
    unit: str
    value: float
    sigma: float
    prior_sigma: float


class FinalObject(msgspec.Struct, frozen=True, kw_only=True):
    """A target by the whole flight; label and height are those of its last line in flight."""

    track: int
    label: str
    north: float
    """NED, metres."""
    east: float
    down: float
    lat: float | None
    lon: float | None
    alt_amsl: float | None
    cov: Matrix3
    """NED, m^2."""
    sightings: int


class TargetErrorObject(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One true target."""

    label: str
    state: str
    """found | fixed (never confirmed) | missed."""
    track: int | None = None
    final_m: float | None
    """Error of its track's last line, metres; None: not found."""
    claimed95_m: float | None = None
    """Larger semi-axis of the last 95 % ellipse, metres."""
    outside95: bool | None = None
    """Whether the error is outside that ellipse."""


class LabelErrorObject(msgspec.Struct, frozen=True, kw_only=True):
    """All true targets of one label: the worst state and the largest error."""

    state: str
    final_m: float | None


class StatisticsObject(msgspec.Struct, frozen=True, kw_only=True):
    """Statistics of errors over all labels, and of each."""

    overall: ErrorStatistics = msgspec.field(name="all")
    labels: dict[str, ErrorStatistics]


class ErrorsObject(msgspec.Struct, frozen=True, kw_only=True):
    """Errors against the truth."""

    fixes: StatisticsObject
    tracks: StatisticsObject
    labels: dict[str, LabelErrorObject]
    targets: list[TargetErrorObject]
    ghosts: int
    """Confirmed tracks without a true target of their own."""


class SummaryLine(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, tag_field="type", tag="summary"):
    """The last line: counts, and what explains the state of the targets."""

    frames: int
    detections: int
    fixes: int
    """Detections that were placed on the ground."""
    dropped: dict[str, int]
    """Refusals of whole frames and of detections together, by reason."""
    dropped_frames: dict[str, int] = msgspec.field(default_factory=no_counts)
    dropped_detections: dict[str, int] = msgspec.field(default_factory=no_counts)
    terrain: ShiftObject | None = None
    landmarks: tuple[LandmarkReport, ...] = ()
    notices: tuple[NoticeObject, ...] = ()
    shared_errors: list[SharedErrorObject] | None = None
    """Of photographs: the errors whose sigma the sights at least halve."""
    final: list[FinalObject] | None = None
    """Of the smoother: targets by the whole flight."""
    errors: ErrorsObject | None = None
    """With truth."""
    limits: dict[int, dict[str, float]] | None = None
    """By track and cause, the horizontal variance that the target would lose if that error were known, m^2."""
