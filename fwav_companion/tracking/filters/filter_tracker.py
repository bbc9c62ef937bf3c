"""The tracker by filters of single targets: the paper's low-pass, or a filter of one's own.

A fix goes in, a state comes out; each filter judges fixes by its own gate, and no error is shared between targets.
Self-calibration moves none of these tracks: a second tracker of the same frames, by the smoother, reports its values.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from fwav_companion.tracking.crowd import Crowd
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.filters.alternation import Alternation
from fwav_companion.tracking.filters.base import Filter, TargetState
from fwav_companion.tracking.filters.filter_frame import FilterFrame, FilterTrack
from fwav_companion.tracking.frame_tracker import FrameTracker
from fwav_companion.tracking.track_table import detector_after
from fwav_companion.types import FrameView, LandmarkAltitude, LandmarkRecord, Reason, Track, TrackState
from fwav_companion.types.calibration_report import CalibrationReport
from fwav_companion.types.flight_status import SolveReport
from fwav_companion.types.tracks import CommonErrors, FinalPlace


class FilterTrackerState(msgspec.Struct, frozen=True):
    """The state between two frames: references to immutable objects."""

    tracks: tuple[FilterTrack, ...] = ()
    """Live tracks by id."""
    next_id: int = 1
    alternation: Alternation = Alternation()
    detector: DetectorModel = DetectorModel()
    unused_fixes: Mapping[Reason, int] = {}
    calibrating: Any = None
    """State of the tracker that self-calibrates, for a return to this state."""


class FilterTracker:
    """Tracks targets through frames in capture order, which :class:`Reorder` ensures."""

    __slots__ = ("_calibrating", "_filter", "_state", "reports_innovations")

    def __init__(self, target_filter: Filter, calibrating: FrameTracker | None = None) -> None:
        """``calibrating``: a second tracker of the same frames, whose calibration is reported."""
        self.reports_innovations = False
        self._filter, self._calibrating, self._state = target_filter, calibrating, FilterTrackerState()

    @property
    def calibration(self) -> CalibrationReport | None:
        """The report of self-calibration; None without it."""
        return None if self._calibrating is None else self._calibrating.calibration

    @property
    def solves(self) -> SolveReport | None:
        """Counts of the smoother's solves; None without a smoother."""
        return None if self._calibrating is None else self._calibrating.solves

    def final_places(self) -> dict[int, FinalPlace]:
        """None: only a smoother has them."""
        return {}

    def common_errors(self) -> dict[int, CommonErrors]:
        """None: only a smoother has them."""
        return {}

    def best_targets(self) -> dict[int, TargetState]:
        """The targets of all live tracks, by id."""
        return {track.id: track.target for track in self._state.tracks if track.id > 0}

    @property
    def crowd(self) -> Crowd:
        """The labels of which more detections fit no track than new targets explain."""
        return self._state.detector.crowd

    @property
    def landmarks(self) -> tuple[LandmarkRecord, ...]:
        """None: landmarks do not correct these tracks."""
        return ()

    @property
    def landmark_altitude(self) -> LandmarkAltitude | None:
        """None: landmarks do not correct these tracks."""
        return None

    @property
    def unused_fixes(self) -> Mapping[Reason, int]:
        """Number of fixes of the newest frame that are assigned to no reported track, by reason."""
        return self._state.unused_fixes

    @property
    def next_id(self) -> int:
        """The id of the next new track."""
        return self._state.next_id

    @next_id.setter
    def next_id(self, next_id: int) -> None:
        self._state = msgspec.structs.replace(self._state, next_id=next_id)

    def snapshot(self) -> FilterTrackerState:
        """The present state, for :meth:`restore`."""
        if self._calibrating is None:
            return self._state
        return msgspec.structs.replace(self._state, calibrating=self._calibrating.snapshot())

    def restore(self, snapshot: FilterTrackerState) -> None:
        """Return to an earlier state, ids included: the same frames then give the same tracks again."""
        self._state = snapshot
        if self._calibrating is not None and snapshot.calibrating is not None:
            self._calibrating.restore(snapshot.calibrating)

    def on_frame(self, view: FrameView) -> tuple[Track, ...]:
        """All tracks after this frame, by id. A track that this frame deleted is included once."""
        if self._calibrating is not None:
            self._calibrating.on_frame(view)
        state = self._state
        before = [
            msgspec.structs.replace(
                track, target=track.target.predict(view.host_ns), fix=None, looked_for=False, innovation=None
            )
            for track in state.tracks
        ]
        frame = FilterFrame(
            before, view, state.detector, state.next_id, self._filter, reports_innovations=self.reports_innovations
        )
        after, elapsed_ns = frame.updated(), view.host_ns - (state.detector.last_ns or view.host_ns)
        missed, ids = [track.id for track in frame.missed], state.detector.ids
        alternation = state.alternation.after_frame(after, missed, elapsed_ns, ids)
        tracks = frame.continued(frame.begun(alternation.merged(after)))
        detector = detector_after(
            state.detector, view.host_ns, before, tracks,
            refused=frame.refused, id_trust=frame.id_trust, crowd=frame.crowd_after(),
        )  # fmt: skip
        living = tuple([track for track in tracks if track.life.state is not TrackState.DROPPED])
        self._state = FilterTrackerState(living, frame.next_id, alternation, detector, frame.unused(tracks))
        return _reports(tracks, view)

    def on_telemetry(self) -> None:
        """Hand the telemetry between two frames to self-calibration: these filters take fixes alone."""
        if self._calibrating is not None:
            self._calibrating.on_telemetry()

    def drop_all(self, reason: Reason, view: FrameView) -> tuple[Track, ...]:
        """Delete every track, as of the newest frame; their ids are not used again."""
        state = self._state
        dropped = [msgspec.structs.replace(t.deleted(reason), fix=None, innovation=None) for t in state.tracks]
        if self._calibrating is not None:
            self._calibrating.drop_all(reason, view)
        self._state = FilterTrackerState(next_id=state.next_id, detector=state.detector)
        return _reports(dropped, view)


def _reports(tracks: Sequence[FilterTrack], view: FrameView) -> tuple[Track, ...]:
    return tuple([track.report(track.target, view) for track in tracks if track.id > 0])
