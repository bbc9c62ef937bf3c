"""The state of a tracker between frames, to which it can return."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import msgspec

from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.filters.wander_evidence import WanderEvidence
from fwav_companion.tracking.joint_compatibility import CommonBiases
from fwav_companion.tracking.track_merging import TrackMerging
from fwav_companion.tracking.track_state import LiveTrack
from fwav_companion.types import Reason

if TYPE_CHECKING:
    from fwav_companion.self_calibration.calibrator import Calibrator
    from fwav_companion.tracking.landmarks.landmark_target import LandmarkTracking


class Snapshot(msgspec.Struct, frozen=True):
    """The state of a tracker: references to immutable objects."""

    alive: tuple[LiveTrack, ...] = ()
    """Live tracks by id."""
    next_id: int = 1
    calibrator: Calibrator | None = None
    """None without self-calibration."""
    calibrating: Any = None
    """State of the tracker that self-calibrates instead of this one, for a return to this state."""
    merging: TrackMerging = TrackMerging()
    detector: DetectorModel = DetectorModel()
    unused_fixes: Mapping[Reason, int] = {}
    """Number of fixes of the newest frame that are assigned to no reported track, by reason."""
    landmarks: LandmarkTracking | None = None
    """None without landmarks."""
    wander: WanderEvidence | None = None
    """Evidence of how the vehicle's position wanders; None before the first target showed any."""
    biases: CommonBiases | None = None
    """Shared errors estimated by the innovations of all targets; None before any innovation was learned."""
