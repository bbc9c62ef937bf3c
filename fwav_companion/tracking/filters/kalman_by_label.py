"""Initiates static and moving targets together, each by the motion of its label: a pad on a boat, a mast ashore."""

from __future__ import annotations

from fwav_companion.tracking.filters.base import TargetState
from fwav_companion.tracking.filters.kalman import StaticKalman
from fwav_companion.tracking.filters.moving import MovingKalman
from fwav_companion.tracking.motions import Motions
from fwav_companion.types import ErrorPriors, GroundFix


class KalmanByLabel:
    """Initiates each target by the motion of its label."""

    __slots__ = ("_motions", "_moving", "_static")

    def __init__(self, priors: ErrorPriors, motions: Motions) -> None:
        self._motions, self._static, self._moving = motions, StaticKalman(priors), MovingKalman(priors)

    def initiate(self, fix: GroundFix) -> TargetState:
        """The state after the first fix."""
        moves = self._motions.moves(fix.sighting.detection.label)
        return self._moving.initiate(fix) if moves else self._static.initiate(fix)
