"""The constants of a flight's self-calibration: priors, hypotheses of the delay, and the source of vehicle states."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, hypot

import numpy as np

from fwav_companion.geometry.stamps import s_from_ns
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.calibration_report import KeptCalibration, SharedParameter
from fwav_companion.self_calibration.delayed_poses import StateAt, delayed_poses
from fwav_companion.self_calibration.filter_pass import FilterPass, filter_pass
from fwav_companion.self_calibration.frame_fixes import FrameFixes
from fwav_companion.self_calibration.innovation_consistency import drift_of
from fwav_companion.self_calibration.joint_filter import JointFilter, joint_filter
from fwav_companion.self_calibration.measurement_batch import MeasurementBatch, measurement_batch
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT
from fwav_companion.self_calibration.position_error import QUICK, SMOOTH
from fwav_companion.self_calibration.position_path import PositionPath, SmoothedReport
from fwav_companion.types import Bias, ErrorPriors, GroundFix, VehicleState

DELAY_STEP_S = 0.015
"""Interval of the delay hypotheses, s: a fifth of a beat at 15 Hz, so one of them is always in the linear range."""
STEP_SIGMA_S = 0.6 * DELAY_STEP_S
"""One sigma of a hypothesis's delay, s: a delay beyond half a step belongs to the next hypothesis."""
SEARCH_SIGMAS = 3.0
KNOT_S = 0.012
"""Interval at which states within the readout of a frame are requested, s. Extrapolation over half of it with linear
rates errs by 0.006 degrees for a beat of 5 degrees at 5 Hz, and by 0.05 at 10 Hz: half of an attitude's own noise."""


class CalibrationContext:
    """The constants: priors, hypotheses of the delay, the source of vehicle states; and what a frame computes once."""

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
        self._frame = FrameFixes((), state_at)
        self._report: tuple[PositionPath, VehicleState, SmoothedReport | None] | None = None

    def without_kept(self) -> CalibrationContext:
        """The context without the calibration of an earlier flight."""
        return CalibrationContext(self.priors, self.state_at)

    @property
    def searches(self) -> bool:
        """Whether there is more than one hypothesis of the delay."""
        return len(self.delays) > 1

    def batch(
        self, fixes: Sequence[tuple[int, GroundFix]], delay_s: float | None, since_s: Sequence[float]
    ) -> MeasurementBatch:
        """The batch of ``fixes`` (track, fix) close in time, with poses at ``delay_s``; None: at all hypotheses.

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
        """Remember the fixes of a frame, so that later requests are computed for all of them at once."""
        self._frame = FrameFixes(fixes, self.state_at)

    def frame_of(self, fix: GroundFix) -> FrameFixes:
        """The newest frame if it holds this fix; otherwise a frame of this fix alone, which replaces it."""
        if fix not in self._frame:
            self.expect([fix])
        return self._frame

    def smoothed(self, path: PositionPath, vehicle: VehicleState) -> SmoothedReport | None:
        """``path.report(vehicle)``, computed once for all targets without a fix in the frame."""
        if self._report is None or self._report[0] is not path or self._report[1] is not vehicle:
            self._report = (path, vehicle, path.report(vehicle, self.priors))
        return self._report[2]

    def bank(self) -> FilterPass:
        """A pass with one hypothesis for each delay, each with a prior as wide as their interval."""
        points = np.tile(self.means, (len(self.delays), 1))
        points[:, SharedParameter.DELAY] = self.delays
        return self._hypotheses(points, {})

    def trials(self, ended: JointFilter) -> FilterPass:
        """A pass about the final means of another, with the same prior widths as the bank."""
        points = ended.mean[:, :SHARED_COUNT].copy()
        return self._hypotheses(points, ended.targets)

    def served_pass(self, point: Array, hints: dict[int, Array] | None = None) -> FilterPass:
        """A pass about one linearization point, by the priors of this context, under both kinds of wander."""
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
    """Means and one sigma of the shared parameters."""
    b, mount = priors.bias_sigmas, mount_sigmas(priors)
    rest = (b[Bias.HEADING], b[Bias.HEIGHT], b[Bias.READOUT])
    place = (b[Bias.POSITION_DELAY], b[Bias.LEVER_X], b[Bias.LEVER_Y], b[Bias.LEVER_Z])
    means = np.zeros(SHARED_COUNT)
    if kept is None:
        return means, np.array((b[Bias.TIME_OFFSET], *mount, *rest, *place))
    means[: SharedParameter.HEADING] = (kept.time_offset_s, *kept.mount)
    return means, np.array((kept.time_offset_sigma_s, *kept.mount_sigma, *rest, *place))


def mount_sigmas(priors: ErrorPriors) -> Vector3:
    """One sigma of the mount's correction, rad: the autopilot's constant roll and pitch errors are part of it."""
    b = priors.bias_sigmas
    return (hypot(b[Bias.MOUNT_X], b[Bias.ROLL]), hypot(b[Bias.MOUNT_Y], b[Bias.PITCH]), b[Bias.MOUNT_Z])
