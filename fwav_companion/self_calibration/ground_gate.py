"""The gate of the joint estimate: all fixes of a frame against all targets, by their points on the ground.

The points use the exact attitude at the capture; the sensitivities are those of the fixes at their nominal captures.
Gating in pixels takes three times as long; over figure-eights of a wing, its normalised innovations agree with these to
a fifth.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isnan

import numpy as np

from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.calibrated_fix import SIGNS, bias_rows
from fwav_companion.self_calibration.delayed_poses import StateAt
from fwav_companion.self_calibration.ground_points import GATE_KNOT_NS, GroundPoints
from fwav_companion.self_calibration.joint_filter import JointFilter
from fwav_companion.self_calibration.pixel_innovations import LEAST_DETERMINANT, two_by_two
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT
from fwav_companion.types import GroundFix
from fwav_companion.types.tracks import GateResult


class GroundGate:
    """Gating statistics of all fixes of one frame against all targets of a joint estimate with one hypothesis."""

    def __init__(self, joint: JointFilter, fixes: Sequence[GroundFix], state_at: StateAt) -> None:
        points = GroundPoints(joint.mean[0, :SHARED_COUNT].tolist(), fixes[0].sighting, state_at, GATE_KNOT_NS)
        off = np.array([points.of(fix) for fix in fixes]) - joint.apparent[0].reshape(-1, 1, 2)
        noise = np.array([fix.noise_cov for fix in fixes])[:, :2, :2]
        rows = bias_rows(fixes) * SIGNS  # negative sensitivities of the points to the shared parameters
        spread = _spread(noise, rows, joint.apparent_cov)
        nowhere = np.isinf(off).any(-1)  # infinite terms of both signs would sum to NaN, which means not known
        off[nowhere] = 0.0
        nis, determinant = two_by_two(off, spread[..., 0, 0], spread[..., 0, 1], spread[..., 1, 1])
        alone = noise[:, 0, 0] * noise[:, 1, 1] - noise[:, 0, 1] * noise[:, 0, 1]
        self._nis: list[list[float]] = np.where(nowhere, inf, nis).tolist()
        self._log_det: list[list[float]] = np.log(np.maximum(determinant, LEAST_DETERMINANT) / alone).tolist()

    def gate(self, place: int, index: int) -> GateResult | None:
        """Gating statistics of the fix with this ``index`` against the target with the index ``place``; None where the
        vehicle's state at the capture is not known.
        """
        nis = self._nis[place][index]
        return None if isnan(nis) else GateResult(nis, self._log_det[place][index])


def _spread(noise: Array, rows: Array, cov: Array) -> Array:
    """(T, N, 2, 2) covariance of each point minus each target's place. ``cov``: of shared parameters and places."""
    own = noise + rows @ cov[:SHARED_COUNT, :SHARED_COUNT] @ rows.swapaxes(1, 2)
    both = (rows @ cov[:SHARED_COUNT, SHARED_COUNT:]).reshape(len(rows), 2, -1, 2).transpose(2, 0, 1, 3)
    targets = np.arange(len(both))
    places = cov[SHARED_COUNT:, SHARED_COUNT:].reshape(len(both), 2, len(both), 2)[targets, :, targets]
    return np.asarray(own + places[:, None] + both + both.swapaxes(2, 3))
