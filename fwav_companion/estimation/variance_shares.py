"""Error budget of a target: the horizontal variance that it would lose if one cause of error were exactly known."""

from __future__ import annotations

from typing import Final

import numpy as np

from fwav_companion.estimation.errors import (
    CAMERA_DELAY,
    GIMBAL_DELAY,
    GIMBAL_HEADING,
    HEADING,
    HEIGHT,
    PITCH,
    POSITION_DELAY,
    READOUT,
    ROLL,
    Array,
)
from fwav_companion.estimation.live_filter import LiveFilter

CAUSES: Final = {
    "time": (CAMERA_DELAY, GIMBAL_DELAY),
    "mount": (1, 2, 3),
    "heading": (HEADING, GIMBAL_HEADING),
    "attitude": (ROLL, PITCH),
    "position_delay": (POSITION_DELAY,),
    "lever_arm": (9, 10, 11),
    "readout": (READOUT,),
}
"""Shared parameters by cause of error, the gimbal's among them where there is one."""

ROUNDING_M2: Final = 1e-12
"""A smaller share is that of a prior of zero, which is a small one here."""


def variance_shares(live: LiveFilter | None, target: int) -> dict[str, float]:
    """Variance (m^2) of a target by cause; empty where the filter does not hold it.

    The errors of position and height are those now, which the target's place shares.
    """
    if live is None or target not in live:
        return {}
    (_, own), cross, error = live.place(target), live.cross(target), live.error
    causes = {cause: [i for i in index if i < live.size] for cause, index in CAUSES.items()}
    causes["time"] += range(error - live.curved, error)
    causes |= {"position": [error, error + 1], "height": [HEIGHT, error + 2]}
    shares = {
        cause: _lost(own, cross[:, index], live.covariance[np.ix_(index, index)]) for cause, index in causes.items()
    }
    shares["position"] *= _share_of_receiver(live)
    shares["terrain"] = _lost(own, own[:, 2:], own[2:, 2:])
    return shares


def _share_of_receiver(live: LiveFilter) -> float:
    """Share of the position's error that is the receiver's wander: what the path's smoothing leaves is noise."""
    wander, _ = live.wanders
    left_m, _ = wander.path
    if live.carrier.path.breaks:  # a step of the report is the receiver's, too
        return 1.0
    return wander.sigma_m**2 / (wander.sigma_m**2 + left_m**2)


def _lost(own: Array, cross: Array, covariance: Array) -> float:
    """Horizontal variance (m^2) that a target (3, 3) loses if errors (k, k) are known; cross: (3, k) with them."""
    level = cross[:2]
    lost = float(np.trace(level @ np.linalg.pinv(covariance, hermitian=True) @ level.T))
    return min(lost, float(own[0, 0] + own[1, 1])) if lost > ROUNDING_M2 else 0.0
