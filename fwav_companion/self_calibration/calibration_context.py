"""What of self-calibration never changes in a flight: priors, the delays to try, and whom to ask for states."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

from fwav_companion.geometry.stamps import BootNs, ns_from_s
from fwav_companion.self_calibration.delayed_poses import DelayedPoses, StateAt, delayed_poses
from fwav_companion.self_calibration.filter_pass import FilterPass
from fwav_companion.self_calibration.innovation_consistency import drift_of
from fwav_companion.self_calibration.joint_filter import JointFilter, joint_of
from fwav_companion.self_calibration.pixel_measurement import COMMON_COUNT, SharedParameter, pixel_measurement
from fwav_companion.self_calibration.prepared_measurement import PreparedMeasurement, compared
from fwav_companion.self_calibration.rate_denoiser import SPAN_S, SmoothedMotion, slow_between
from fwav_companion.self_calibration.report import KeptCalibration
from fwav_companion.types import Bias, ErrorPriors, GroundFix, Unpaired, VehicleState

NO_TRACK = 0
DELAY_STEP_S = 0.015
"""Between two hypotheses: a fifth of a beat at 15 Hz, so one of them is always in the linear range."""
STEP_SIGMA_S = 0.6 * DELAY_STEP_S
"""How far a hypothesis may move: what lies beyond half a step is the next one's."""
SEARCH_SIGMAS = 3.0
MOST_REMEMBERED = 64
"""Fixes: those of a frame and more."""


class CalibrationContext:
    """What never changes: the priors, the delays to try, and whom to ask for the vehicle's states."""

    def __init__(self, priors: ErrorPriors, state_at: StateAt | None, kept: KeptCalibration | None = None) -> None:
        self.priors = priors
        self.state_at = state_at
        self.kept = kept
        self._remembered: tuple[tuple[int, tuple[float, ...]], DelayedPoses] | None = None
        self._compared: dict[int, tuple[GroundFix, PreparedMeasurement | None]] = {}
        self._compared_by: tuple[float, JointFilter] | None = None
        self.means, self.sigmas = _prior(priors, kept)
        reach = SEARCH_SIGMAS * self.sigmas[SharedParameter.DELAY]
        steps = int(reach / DELAY_STEP_S + 0.5) if state_at is not None else 0
        middle = self.means[SharedParameter.DELAY]
        self.delays = tuple(middle + i * DELAY_STEP_S for i in range(-steps, steps + 1))

    def unlearned(self) -> CalibrationContext:
        """The same without what an earlier flight found."""
        return CalibrationContext(self.priors, self.state_at)

    def course(self, nominal: VehicleState, delays_s: tuple[float, ...]) -> DelayedPoses:
        """The vehicle about a capture. Remembers the last one: the sightings of a frame mostly share it."""
        key = (nominal.boot_ns, delays_s)
        if self._remembered is None or self._remembered[0] != key:
            self._remembered = (key, delayed_poses(nominal, delays_s, self.state_at))
        return self._remembered[1]

    def slow(self, nominal: VehicleState, delay_s: float) -> SmoothedMotion:
        """The mean motion about a delay; none where the states that tell it are not known."""
        half_ns, middle_ns = ns_from_s(0.5 * SPAN_S), nominal.boot_ns - ns_from_s(delay_s)
        if self.state_at is None:
            return SmoothedMotion()
        before, after = self.state_at(BootNs(middle_ns - half_ns)), self.state_at(BootNs(middle_ns + half_ns))
        return (
            SmoothedMotion()
            if isinstance(before, Unpaired) or isinstance(after, Unpaired)
            else slow_between(before, after)
        )

    @property
    def searches(self) -> bool:
        """There is more than one delay to try."""
        return len(self.delays) > 1

    def compared(self, fix: GroundFix, delay_s: float, joint: JointFilter) -> PreparedMeasurement | None:
        """A fix as this estimate sees it. Remembers those of a frame: many tracks are asked about each."""
        by = self._compared_by
        if by is None or by[0] != delay_s or by[1] is not joint or len(self._compared) >= MOST_REMEMBERED:
            self._compared_by, self._compared = (delay_s, joint), {}
        remembered = self._compared.get(id(fix))
        if remembered is None or remembered[0] is not fix:
            glimpse = pixel_measurement(NO_TRACK, fix, self.course(fix.sighting.state, (delay_s,)), 0.0)
            remembered = self._compared[id(fix)] = (fix, compared(joint, glimpse))
        return remembered[1]

    def bank(self) -> tuple[FilterPass, ...]:
        """A fit a delay, each with a prior as wide as the step between them."""
        return tuple(self.fit((delay,), STEP_SIGMA_S) for delay in self.delays)

    def trial(self, ended: JointFilter) -> FilterPass:
        """A fit about where another ended, as free to move."""
        return self.fit((*ended.mean[: SharedParameter.NORTH], 0.0, 0.0), STEP_SIGMA_S, ended.places)

    def fit(
        self,
        around: Sequence[float],
        delay_sigma: float | None = None,
        hints: dict[int, tuple[float, float]] | None = None,
    ) -> FilterPass:
        """A fresh fit about a point of linearization; with a sigma, about that delay only."""
        full = (*around, *self.means[len(around) :])
        means, sigmas = self.means, self.sigmas
        if delay_sigma is None:
            return FilterPass(joint_of(self.priors, sigmas, means, full), hints or {}, drift=drift_of(self.priors))
        means = (around[SharedParameter.DELAY], *means[1:])
        sigmas = (delay_sigma, *sigmas[1:])
        return FilterPass(joint_of(self.priors, sigmas, means, full), hints or {})


def _prior(priors: ErrorPriors, kept: KeptCalibration | None) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Means and sigmas by Common. The autopilot's own constant roll and pitch errors are part of the correction."""
    b = priors.bias_sigmas
    mount = (hypot(b[Bias.MOUNT_X], b[Bias.ROLL]), hypot(b[Bias.MOUNT_Y], b[Bias.PITCH]), b[Bias.MOUNT_Z])
    rest = (b[Bias.HEADING], b[Bias.HEIGHT], b[Bias.READOUT], b[Bias.POSITION_NORTH], b[Bias.POSITION_EAST])
    zero = (0.0,) * COMMON_COUNT
    if kept is None:
        return zero, (b[Bias.TIME_OFFSET], *mount, *rest)
    return (kept.time_offset_s, *kept.mount, *zero[4:]), (kept.time_offset_sigma_s, *kept.mount_sigma, *rest)
