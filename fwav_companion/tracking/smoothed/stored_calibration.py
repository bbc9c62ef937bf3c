"""The calibration of an earlier flight as this flight's priors, until this flight contradicts it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fwav_companion.estimation.errors import CAMERA_DELAY, MOUNT, SharedPriors
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.solve import Estimate
from fwav_companion.estimation.wander import SMOOTH
from fwav_companion.tracking.smoothed.parameter_reports import camera_statuses

DENIALS = 2
"""Solves in a row that contradict it before it is dropped: the first one sees a second of sightings."""


@dataclass(frozen=True)
class StoredCalibration:
    """What is left of it."""

    configured: SharedPriors
    """The priors without it."""
    denials: int = 0
    """Solves in a row that contradict it."""
    dropped: bool = False

    def judged(self, estimator: Estimator) -> StoredCalibration:
        """After a solve: dropped where the camera's delay or mount is not what it says, as of a camera that was moved.

        The estimator then starts again from the configuration's priors with the sightings that it has kept.
        """
        if self.dropped or estimator.model.priors is self.configured:
            return self
        statuses = camera_statuses(estimator)
        contradicts = any(each.status == "contradicts" for each in (statuses[CAMERA_DELAY], *statuses[MOUNT]))
        denials = self.denials + 1 if contradicts else 0
        if denials < DENIALS:
            return replace(self, denials=denials)
        _restart(estimator, self.configured)
        return replace(self, denials=0, dropped=True)


def _restart(estimator: Estimator, priors: SharedPriors) -> None:
    """Let the next solve begin at these priors. Until it is taken over, the live filter answers as before."""
    estimator.model = replace(estimator.model, priors=priors)
    estimator.estimate = Estimate(-np.inf, priors.mean, {}, np.zeros(0), np.zeros((0, 3)), SMOOTH)
    if estimator.live is not None:
        estimator.live.model = estimator.model
