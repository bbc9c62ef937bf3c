"""The fixes of one frame, with results that are computed for all of them at once and requested one by one."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from fwav_companion.self_calibration.calibrated_fix import SIGNS, CalibratedFix, KnownParameters, without_height_noise
from fwav_companion.self_calibration.delayed_poses import StateAt
from fwav_companion.self_calibration.filter_pass import FilterPass
from fwav_companion.self_calibration.ground_gate import GroundGate
from fwav_companion.self_calibration.ground_points import FIX_KNOT_NS, GroundPoints
from fwav_companion.self_calibration.position_path import SmoothedReport
from fwav_companion.types import GroundFix
from fwav_companion.types.tracks import GateResult


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
