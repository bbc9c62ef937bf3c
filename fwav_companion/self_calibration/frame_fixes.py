"""The fixes of one frame, with results that are computed for all of them at once and requested one by one.

The gate of the joint estimate compares the fixes' points on the ground with all targets. The points use the exact
attitude at the capture; the sensitivities are those of the fixes at their nominal captures. Gating in pixels takes
three times as long; over figure-eights of a wing, its normalised innovations agree with these to a fifth.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isfinite, isnan

import numpy as np

from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.calibrated_fix import (
    SIGNS,
    CalibratedFix,
    KnownParameters,
    bias_rows,
    without_height_noise,
)
from fwav_companion.self_calibration.delayed_poses import StateAt
from fwav_companion.self_calibration.filter_pass import FilterPass
from fwav_companion.self_calibration.ground_points import FIX_KNOT_NS, GATE_KNOT_NS, GroundPoints
from fwav_companion.self_calibration.joint_filter import JointFilter
from fwav_companion.self_calibration.pixel_innovations import LEAST_DETERMINANT, two_by_two
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT
from fwav_companion.self_calibration.position_path import SmoothedReport
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


class FrameFixes:
    """The fixes of one frame, with a cache of results. Each result is cached with the estimate it was computed from."""

    def __init__(self, fixes: Sequence[GroundFix], state_at: StateAt | None) -> None:
        self._fixes = tuple(fixes)  # keeps them alive, so that no other object gets their id()
        self._index = {id(fix): index for index, fix in enumerate(fixes)}
        self._state_at = state_at
        self._gate: tuple[FilterPass, GroundGate] | None = None
        self._claims: tuple[KnownParameters, list[list[list[float]]]] | None = None
        self._points: tuple[KnownParameters, GroundPoints] | None = None

    def __contains__(self, fix: GroundFix) -> bool:
        return id(fix) in self._index

    def gate(self, fix: GroundFix, place: int, present: FilterPass) -> GateResult | None:
        """Gating statistics of a fix against a target of the joint estimate; ``place``: index of the target.

        None where the vehicle's state at the capture is not known.
        """
        if self._state_at is None:
            return None
        if self._gate is None or self._gate[0] is not present:
            self._gate = (present, GroundGate(present.best, self._fixes, self._state_at))
        return self._gate[1].gate(place, self._index[id(fix)])

    def alone(
        self, fix: GroundFix, known: KnownParameters, smoothed: SmoothedReport | None, below_m2: float
    ) -> CalibratedFix | None:
        """Place of a fix corrected by the shared parameters, at the height of the smoothed path.

        None where the trace of its covariance is not below ``below_m2``, where the vehicle's state at its capture is
        not known, as after the newest attitude, or where its ray does not meet the ground.
        """
        if self._claims is None or self._claims[0] is not known:
            self._claims = (known, known.claims(self._fixes))
        (nn, ne), (_, ee) = self._claims[1][self._index[id(fix)]]
        r_nn, r_ne, r_ee = known.noise(fix, smoothed)
        if r_nn + nn + r_ee + ee >= below_m2:
            return None
        place = self._place(fix, known)
        if place is None:
            return None
        return CalibratedFix(*without_height_noise(fix, place, smoothed), (r_nn + nn, r_ne + ne, r_ee + ee))

    def _place(self, fix: GroundFix, known: KnownParameters) -> tuple[float, float] | None:
        """North and east of a corrected fix relative to the vehicle's report: by the exact attitude at its capture if a
        history is available, otherwise to first order. None where the history has no state at the capture, or where the
        ray does not meet the ground.
        """
        if self._state_at is None:
            return known.linear(fix)
        if self._points is None or self._points[0] is not known:
            mean = (known.mean * SIGNS).tolist()  # from biases of a fix back to shared parameters
            self._points = (known, GroundPoints(mean, fix.sighting, self._state_at, FIX_KNOT_NS))
        place = self._points[1].in_report_of(fix)
        return place if isfinite(place[0]) else None


def _spread(noise: Array, rows: Array, cov: Array) -> Array:
    """(T, N, 2, 2) covariance of each point minus each target's place. ``cov``: of shared parameters and places."""
    own = noise + rows @ cov[:SHARED_COUNT, :SHARED_COUNT] @ rows.swapaxes(1, 2)
    both = (rows @ cov[:SHARED_COUNT, SHARED_COUNT:]).reshape(len(rows), 2, -1, 2).transpose(2, 0, 1, 3)
    targets = np.arange(len(both))
    places = cov[SHARED_COUNT:, SHARED_COUNT:].reshape(len(both), 2, len(both), 2)[targets, :, targets]
    return np.asarray(own + places[:, None] + both + both.swapaxes(2, 3))
