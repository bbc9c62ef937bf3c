"""The constants of a flight's self-calibration: priors, hypotheses of the delay, and the source of vehicle states."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from math import ceil, hypot, isfinite

import numpy as np

from fwav_companion.geometry.stamps import BootNs, s_from_ns
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.calibrated_fix import SIGNS, KnownParameters, OnGround
from fwav_companion.self_calibration.calibration_report import KeptCalibration, SharedParameter
from fwav_companion.self_calibration.delayed_poses import StateAt, delayed_poses
from fwav_companion.self_calibration.filter_pass import FilterPass, filter_pass
from fwav_companion.self_calibration.ground_gate import GroundGate
from fwav_companion.self_calibration.ground_points import FIX_KNOT_NS, GroundPoints
from fwav_companion.self_calibration.innovation_consistency import drift_of
from fwav_companion.self_calibration.joint_filter import JointFilter, joint_filter
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT, MeasurementBatch, measurement_batch
from fwav_companion.self_calibration.position_error import QUICK, SMOOTH
from fwav_companion.self_calibration.position_path import PositionPath, SmoothedReport
from fwav_companion.types import Bias, ErrorPriors, GroundFix, VehicleState
from fwav_companion.types.tracks import GateResult

DELAY_STEP_S = 0.015
"""Interval of the hypotheses: a fifth of a beat at 15 Hz, so one of them is always in the linear range."""
STEP_SIGMA_S = 0.6 * DELAY_STEP_S
"""One sigma of a hypothesis: what lies beyond half a step belongs to the next one."""
SEARCH_SIGMAS = 3.0
KNOT_S = 0.012
"""Interval at which states within the readout of a frame are requested. Extrapolated by half of it with linear rates, a
beat of 5 degrees at 5 Hz errs by 0.006 degrees, at 10 Hz by 0.05: half of an attitude's own noise."""


class CalibrationContext:
    """The constants: priors, hypotheses of the delay, and the source of vehicle states."""

    def __init__(self, priors: ErrorPriors, state_at: StateAt | None, kept: KeptCalibration | None = None) -> None:
        self.priors = priors
        self.state_at = state_at
        self.kept = kept
        self.shared_priors = _shared_priors(priors, kept)
        """Means and one sigma of the shared parameters."""
        self.means, self.sigmas = self.shared_priors
        self.delay_s = float(self.means[SharedParameter.DELAY])
        """Expected delay before any measurement."""
        reach = SEARCH_SIGMAS * float(self.sigmas[SharedParameter.DELAY])
        steps = int(reach / DELAY_STEP_S + 0.5) if state_at is not None else 0
        self.delays = tuple(self.delay_s + i * DELAY_STEP_S for i in range(-steps, steps + 1))
        # The newest frame: its fixes, and their gate by a joint estimate.
        self._frame: tuple[GroundFix, ...] = ()
        self._places: dict[int, int] = {}
        self._gate: tuple[FilterPass, GroundGate] | None = None
        self._ground: tuple[KnownParameters, GroundPoints] | None = None
        self._report: tuple[PositionPath, BootNs, SmoothedReport | None] | None = None

    def without_kept(self) -> CalibrationContext:
        """The same without the calibration of an earlier flight."""
        return CalibrationContext(self.priors, self.state_at)

    @property
    def searches(self) -> bool:
        """Whether there is more than one hypothesis of the delay."""
        return len(self.delays) > 1

    def batch(
        self, fixes: Sequence[tuple[int, GroundFix]], delay_s: float | None, since_s: Sequence[float]
    ) -> MeasurementBatch:
        """The measurements of fixes close in time by track, with poses at the delay, or at all hypotheses.

        ``since_s``: time since the previous measurement of each track.
        """
        states = [fix.sighting.state for _, fix in fixes]
        poses = delayed_poses(states, self._grid(states, delay_s), self.state_at)
        return measurement_batch(fixes, poses, since_s)

    def _grid(self, states: Sequence[VehicleState], delay_s: float | None) -> list[float]:
        """Delays before the first capture at which the states of all captures are requested."""
        stamps = [state.boot_ns for state in states]
        span_s = s_from_ns(max(stamps) - min(stamps))
        if delay_s is None:
            more = int(span_s / DELAY_STEP_S + 0.5)
            return [self.delays[0] - k * DELAY_STEP_S for k in range(more, 0, -1)] + list(self.delays)
        distinct = sorted(set(stamps))
        knots = ceil(span_s / KNOT_S)
        if len(distinct) <= knots + 1:
            return [delay_s - s_from_ns(stamp - distinct[0]) for stamp in reversed(distinct)]
        return [delay_s - k * span_s / max(1, knots) for k in range(knots, -1, -1)]

    def expect(self, fixes: Sequence[GroundFix]) -> None:
        """Remember the fixes of a frame: they are gated as one batch."""
        self._frame, self._gate = tuple(fixes), None
        self._places = {id(fix): place for place, fix in enumerate(fixes)}

    def gate(self, fix: GroundFix, place: int, served: FilterPass) -> GateResult | None:
        """Gating statistics of a fix against the target at this place of the joint estimate; None: not known."""
        if self.state_at is None:
            return None
        if id(fix) not in self._places:  # the frame holds its fixes, so that no other object has their identity
            self.expect([fix])
        if self._gate is None or self._gate[0] is not served:
            self._gate = (served, GroundGate(served.best, self._frame, self.state_at))
        return self._gate[1].gate(place, self._places[id(fix)])

    def on_ground(self, known: KnownParameters) -> OnGround:
        """The places of fixes by the parameters: by the exact attitude at the capture, where a history is available."""
        return known.linear if self.state_at is None else partial(self._met, known, self.state_at)

    def _met(self, known: KnownParameters, state_at: StateAt, fix: GroundFix) -> tuple[float, float] | None:
        if self._ground is None or self._ground[0] is not known or not self._ground[1].covers(fix.sighting):
            mean = (known.mean * SIGNS).tolist()
            self._ground = known, GroundPoints(mean, fix.sighting, state_at, FIX_KNOT_NS)
        place = self._ground[1].in_report_of(fix)
        return place if isfinite(place[0]) else None

    def smoothed_report(self, path: PositionPath, vehicle: VehicleState) -> SmoothedReport | None:
        """Noise of one report of the vehicle's position by the path up to it; the same for all fixes of a frame."""
        if self._report is None or self._report[0] is not path or self._report[1] != vehicle.boot_ns:
            self._report = (path, vehicle.boot_ns, path.report(vehicle, self.priors))
        return self._report[2]

    def bank(self) -> FilterPass:
        """A pass with one hypothesis for each delay, each with a prior as wide as their interval."""
        points = np.tile(self.means, (len(self.delays), 1))
        points[:, SharedParameter.DELAY] = self.delays
        return self._hypotheses(points, {})

    def trials(self, ended: JointFilter) -> FilterPass:
        """A pass about the end of another, as free to move."""
        points = ended.mean[:, :SHARED_COUNT].copy()
        return self._hypotheses(points, ended.targets)

    def served_pass(self, point: Array, hints: dict[int, Array] | None = None) -> FilterPass:
        """A pass about one linearization point, by the priors of the configuration, under both kinds of wander."""
        count = 2 if self.priors.sigma(Bias.POSITION_NORTH) > 0.0 else 1
        means, points = np.tile(self.means, (count, 1)), np.tile(point, (count, 1))
        joint = joint_filter(self.priors, self.sigmas, means, points, (QUICK, SMOOTH) if count == 2 else None)
        hints = {track: np.tile(hint[:1], (count, 1)) for track, hint in (hints or {}).items()}
        return filter_pass(joint, hints, drift_of(self.priors))

    def _hypotheses(self, points: Array, hints: dict[int, Array]) -> FilterPass:
        means, sigmas = np.tile(self.means, (len(points), 1)), self.sigmas.copy()
        means[:, SharedParameter.DELAY], sigmas[SharedParameter.DELAY] = points[:, SharedParameter.DELAY], STEP_SIGMA_S
        return filter_pass(joint_filter(self.priors, sigmas, means, points), hints)


def _shared_priors(priors: ErrorPriors, kept: KeptCalibration | None) -> tuple[Array, Array]:
    """Means and one sigma of the shared parameters. The autopilot's constant roll and pitch errors are part of the
    mount's correction.
    """
    b = priors.bias_sigmas
    mount = (hypot(b[Bias.MOUNT_X], b[Bias.ROLL]), hypot(b[Bias.MOUNT_Y], b[Bias.PITCH]), b[Bias.MOUNT_Z])
    rest = (b[Bias.HEADING], b[Bias.HEIGHT], b[Bias.READOUT])
    place = (b[Bias.POSITION_DELAY], b[Bias.LEVER_X], b[Bias.LEVER_Y], b[Bias.LEVER_Z])
    means = np.zeros(SHARED_COUNT)
    if kept is None:
        return means, np.array((b[Bias.TIME_OFFSET], *mount, *rest, *place))
    means[: SharedParameter.HEADING] = (kept.time_offset_s, *kept.mount)
    return means, np.array((kept.time_offset_sigma_s, *kept.mount_sigma, *rest, *place))
