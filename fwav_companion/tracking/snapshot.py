"""The state of a tracker between frames, to which it can return."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

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
    calibrating: Snapshot | None = None
    """State of the tracker that calibrates in the place of this one, where it is to return to."""
    merging: TrackMerging = TrackMerging()
    detector: DetectorModel = DetectorModel()
    unused_fixes: Mapping[Reason, int] = {}
    """Fixes of the newest frame that no reported track has, by reason."""
    landmarks: LandmarkTracking | None = None
    """None without landmarks."""
    wander: WanderEvidence | None = None
    """How the vehicle's position wanders; None before the first target showed it."""
    biases: CommonBiases | None = None
    """What the innovations of all targets show of the errors that they share; None before that."""
