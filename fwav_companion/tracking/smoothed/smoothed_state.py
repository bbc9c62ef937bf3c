"""The smoothing tracker's state between two frames, to which a late frame returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import msgspec

from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.smoothed.mount_turns import MountTurns
from fwav_companion.tracking.smoothed.smoothed_landmarks import SmoothedLandmarks
from fwav_companion.tracking.smoothed.smoothed_track import SmoothedTrack
from fwav_companion.tracking.smoothed.solve_jobs import PendingSolve
from fwav_companion.tracking.smoothed.stored_calibration import StoredCalibration
from fwav_companion.types import GroundReference, Reason


class StillTarget(msgspec.Struct, frozen=True):
    """The hypothesis that a target that may move is where it was: a static target in the estimator."""

    number: int
    """Its number in the estimator."""
    since_ns: HostNs
    refused: int = 0
    """Number of sightings in a row outside its gate."""
    teaches: bool = False


@dataclass
class SmoothedState:
    """The state after a frame."""

    estimator: Estimator
    landmarks: SmoothedLandmarks
    reference: GroundReference
    """The ground of the estimator's model."""
    stored: StoredCalibration
    relative: bool = False
    """Whether there is no position: a static target stays where it is relative to the vehicle."""
    next_id: int = 1
    next_still: int = 0
    pending: PendingSolve | None = None
    tracks: tuple[SmoothedTrack, ...] = ()
    """Live tracks by id."""
    detector: DetectorModel = field(default_factory=DetectorModel)
    waiting: dict[int, tuple[Sightings, ...]] = field(default_factory=dict)
    """Sightings that solves do not use yet, by number in the estimator."""
    still: dict[int, StillTarget] = field(default_factory=dict)
    """By id of a track that may move."""
    taught: dict[int, int] = field(default_factory=dict)
    """Tracks of the still targets that teach or taught, by the targets' numbers."""
    turns: MountTurns = field(default_factory=MountTurns)
    unused_fixes: Mapping[Reason, int] = field(default_factory=dict)
    """Number of fixes of the newest frame that are assigned to no reported track, by reason."""

    def copy(self) -> SmoothedState:
        """A snapshot."""
        return replace(
            self, estimator=self.estimator.copy(), landmarks=self.landmarks.copy(), waiting=dict(self.waiting),
            still=dict(self.still), taught=dict(self.taught), turns=self.turns.copy(),
        )  # fmt: skip

    def track_of(self, number: int) -> int:
        """The track of a number in the estimator."""
        return self.taught.get(number, number)
