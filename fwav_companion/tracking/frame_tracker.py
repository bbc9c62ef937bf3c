"""The protocol of a tracker: frames in capture order go in, all tracks come out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.self_calibration import CalibrationReport
from fwav_companion.tracking.crowd import Crowd
from fwav_companion.tracking.filters.base import ReportedTarget
from fwav_companion.types import FrameView, LandmarkAltitude, LandmarkRecord, Reason, Track
from fwav_companion.types.flight_status import SolveReport
from fwav_companion.types.tracks import CommonErrors, FinalPlace


class FrameTracker(Protocol):
    """Tracks targets through frames in capture order, which :class:`Reorder` ensures."""

    reports_innovations: bool
    """Whether tracks report innovations. A flight does not use them."""
    next_id: int
    """The id of the next new track."""

    @property
    def calibration(self) -> CalibrationReport | None:
        """The report of self-calibration; None without it."""

    @property
    def solves(self) -> SolveReport | None:
        """Counts of the smoother's solves; None without a smoother."""

    def final_places(self) -> dict[int, FinalPlace]:
        """Targets by the whole flight, by id: only a smoother has them."""
        ...

    @property
    def crowd(self) -> Crowd:
        """The labels of which more detections fit no track than new targets explain."""

    @property
    def landmarks(self) -> tuple[LandmarkRecord, ...]:
        """The record of each landmark's sights so far."""

    @property
    def landmark_altitude(self) -> LandmarkAltitude | None:
        """The vehicle's altitude relative to a landmark's; None before a landmark was seen often enough."""

    @property
    def unused_fixes(self) -> Mapping[Reason, int]:
        """Number of fixes of the newest frame that are assigned to no reported track, by reason."""

    @property
    def due_ns(self) -> HostNs | None:
        """Instant at which self-calibration catches up even if no further frame comes."""

    def catch_up(self, now_ns: HostNs) -> None:
        """Let self-calibration process what is due while no frame comes."""

    def best_targets(self) -> Mapping[int, ReportedTarget]:
        """The reported targets of all live tracks, by id."""
        ...

    def common_errors(self) -> Mapping[int, CommonErrors]:
        """Errors that the reported targets share with others, by id: only the smoother has them."""
        ...

    def snapshot(self) -> Any:
        """The present state, for :meth:`restore`."""

    def restore(self, snapshot: Any, /) -> None:
        """Return to an earlier state, ids included: the same frames then give the same tracks again."""

    def on_frame(self, view: FrameView) -> tuple[Track, ...]:
        """All tracks after this frame, by id. A track that this frame deleted is included once."""
        ...

    def drop_all(self, reason: Reason, view: FrameView) -> tuple[Track, ...]:
        """Delete every track, as of the newest frame; their ids are not used again."""
        ...
