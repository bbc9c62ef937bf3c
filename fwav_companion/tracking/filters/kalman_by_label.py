"""Initiates static and moving targets together, each by the motion of its label: a pad on a boat, a mast ashore."""

from __future__ import annotations

from collections.abc import Mapping

from fwav_companion.tracking.filters.base import TargetState
from fwav_companion.tracking.filters.kalman import StaticKalman
from fwav_companion.tracking.filters.moving import MovingKalman
from fwav_companion.types import ErrorPriors, GroundFix


class KalmanByLabel:
    """Initiates each target by the motion of its label."""

    __slots__ = ("_by_label", "_default", "_moving", "_static")

    def __init__(self, priors: ErrorPriors, default: str, by_label: Mapping[str, str]) -> None:
        """``default``: motion of all labels but those of ``by_label``: static or moving."""
        self._static, self._moving = StaticKalman(priors), MovingKalman(priors)
        self._default, self._by_label = default, by_label

    def initiate(self, fix: GroundFix) -> TargetState:
        """The state after the first fix."""
        motion = self._by_label.get(fix.sighting.detection.label, self._default)
        return self._moving.initiate(fix) if motion == "moving" else self._static.initiate(fix)
