"""The state of self-calibration, and the estimates of targets and configuration errors read from it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import hypot, inf

import msgspec

from fwav_companion.geometry.stamps import BootNs, HostNs, ns_from_s
from fwav_companion.geometry.vectors import ZERO3
from fwav_companion.self_calibration.assessment import Assessment, believed
from fwav_companion.self_calibration.calibrated_fix import CalibratedFix
from fwav_companion.self_calibration.calibrated_places import CalibratedPlace
from fwav_companion.self_calibration.calibration_context import CalibrationContext
from fwav_companion.self_calibration.calibration_report import (
    CalibrationStatus,
    PriorInflation,
    SharedParameter,
)
from fwav_companion.self_calibration.delay_search import DelaySearch, NoDelay
from fwav_companion.self_calibration.filter_pass import FilterPass
from fwav_companion.self_calibration.frame_fixes import FrameFixes
from fwav_companion.self_calibration.mean_axes import MeanAxes
from fwav_companion.self_calibration.measurement_queue import MeasurementQueue
from fwav_companion.self_calibration.mount_check import MountCheck
from fwav_companion.self_calibration.named_mounts import NAMED
from fwav_companion.self_calibration.position_path import SmoothedReport
from fwav_companion.self_calibration.posterior import MOUNT_AXES, bias_shares
from fwav_companion.self_calibration.rate_denoiser import SPAN_S
from fwav_companion.self_calibration.relinearization import Relinearization
from fwav_companion.self_calibration.vehicle_motion import VehicleMotion
from fwav_companion.types import GroundFix, Unpaired, VehicleState
from fwav_companion.types.tracks import GateResult

LAG_S = 0.06
"""Lag of the measurements behind the newest frame, s, in addition to the delay: later attitudes must have arrived."""


class CalibrationState(msgspec.Struct, frozen=True, dict=True):
    """The state of self-calibration with its read-only queries; :class:`Calibrator` adds the update steps."""

    context: CalibrationContext
    queue: MeasurementQueue = MeasurementQueue()
    search: DelaySearch | None = None
    """Delay search in progress; None before and after it."""
    no_delay: NoDelay | None = None
    """Result of the last search, if it found no delay."""
    replaced: bool = False
    """Whether this flight contradicted the calibration of an earlier one, which was dropped."""
    passes: Relinearization = Relinearization()
    axes: MeanAxes = MeanAxes()
    motion: VehicleMotion = VehicleMotion()
    """The vehicle's motion at the newest measurements."""
    stamp_sigma_s: float = 0.0
    """One sigma of the instant of the newest attitudes by the unknown delay of their stamps, s."""
    slow_attitude_hz: float | None = None
    """Rate of the newest attitudes, Hz, if their stamps are too uncertain to distinguish delays; otherwise None."""
    idle_until_ns: HostNs = HostNs(0)
    """End of the pause after a search without result."""
    judged: FilterPass | None = None
    """The served pass that was assessed last."""
    present: FilterPass | None = None
    """The pass ``judged``, predicted to the newest frame after a gap."""
    assessment: Assessment | None = None
    """Assessment of ``present``."""
    mount_check: MountCheck = MountCheck()
    host_ns: HostNs = HostNs(0)

    @cached_property
    def due_ns(self) -> HostNs | None:
        """Instant at which waiting fixes are used without a further frame, while the vehicle states are kept."""
        return self.queue.due_without_frame(ns_from_s(self._lag_s()))

    @property
    def delay_s(self) -> float | None:
        """Delay at which the poses of new measurements are taken, s; None until it was found."""
        return self.passes.delay_s

    def expect(self, fixes: Sequence[GroundFix]) -> None:
        """Announce the fixes of a frame before they are gated one by one."""
        self.context.expect(fixes)

    def placed(self, track: int) -> CalibratedPlace | None:
        """Place of a track's target by the joint estimate; None while the estimate does not hold the target."""
        return None if self.assessment is None else self.assessment.places.get(track)

    def bias_shares(self, track: int) -> dict[str, float]:
        """Horizontal variance of a target by cause, m^2; empty while the joint estimate does not hold the target."""
        return {} if self.passes.served is None else bias_shares(self.passes.served.best, track)

    def by_fix(self, track: int, fix: GroundFix, claimed_m2: float) -> CalibratedFix | None:
        """Place of a track's target relative to the vehicle at the capture of this fix.

        Of two places, the joint estimate along the smoothed path and the fix alone, it is the one with the smaller
        covariance; the fix alone where the vehicle's position is known not to wander smoothly.

        Where the two contradict each other, it is the one along the path, because a false detection claims as little
        as a right one; but the fix alone if the previous fix shows the same place, as after a jump of the vehicle's
        position. None where neither trace is below ``claimed_m2``, the trace of the covariance known without this fix.
        """
        assessment, present, placed = self.assessment, self.present, self.placed(track)
        if assessment is None or present is None or placed is None:
            return None
        smoothed = self._smoothed(fix.sighting.state)
        along = placed.along_path(fix.sighting.state, smoothed)
        by_path_m2 = inf if along is None else along.claimed_m2
        below_m2 = inf if present.wanders_quickly else min(claimed_m2, by_path_m2)
        alone = self.context.frame_of(fix).alone(fix, assessment.known, smoothed, below_m2)
        if alone is None or not (along is None or alone.agrees_with(along) or self._is_repeated(track, fix, alone)):
            return along if by_path_m2 < claimed_m2 else None
        return alone

    def in_report(self, track: int, vehicle: VehicleState) -> CalibratedFix | None:
        """Place of a track's target relative to the vehicle's report, at an instant without a fix of the target.

        None where the target's place or the vehicle's velocity is not known.
        """
        placed, variance = self.placed(track), self.context.priors.position_noise_m**2
        all_noise = (ZERO3, (variance, variance, 0.0))  # noise of a report that no path leads to
        smoothed = self.context.smoothed(self.motion.path, vehicle)
        return None if placed is None else placed.along_path(vehicle, smoothed or all_noise)

    def _smoothed(self, vehicle: VehicleState) -> SmoothedReport | None:
        return self.motion.path.report(vehicle, self.context.priors)

    def _is_repeated(self, track: int, fix: GroundFix, alone: CalibratedFix) -> bool:
        """Whether the previous fix of this track shows the same place."""
        before = self.queue.before(track, fix.sighting.frame_host_ns)
        if before is None or self.assessment is None:
            return False
        frame = FrameFixes([before], self.context.state_at)
        earlier = frame.alone(before, self.assessment.known, self._smoothed(before.sighting.state), inf)
        return earlier is not None and earlier.agrees_with(alone)

    @property
    def mistake(self) -> str:
        """Gross mistake of the mount, as a sentence; empty where there is none. With a mistake nothing is estimated."""
        return "" if self._explained else self.mount_check.text

    @property
    def misplaced_m(self) -> float:
        """Error of all published places according to a mount that explains the sights better, one sigma an axis, m."""
        found = self.mount_check.mistake
        return 0.0 if found is None or self._explained else found.misplaced_m

    @property
    def _explained(self) -> bool:
        """Whether self-calibration explains the flight without a gross mistake: a large delay scatters sights, too."""
        if self.assessment is None or not self.is_calibrated:
            return False
        return not self.mount_check.text or hypot(*(self.assessment.parameters[i][0] for i in MOUNT_AXES)) < NAMED

    @property
    def denied(self) -> tuple[PriorInflation, ...]:
        """Priors of the configuration that this flight contradicts."""
        return () if self.assessment is None else self.assessment.denied

    @property
    def is_calibrated(self) -> bool:
        """Whether delay and mount are known."""
        return self.assessment is not None and self.assessment.status is CalibrationStatus.CALIBRATED

    @property
    def answers(self) -> bool:
        """Whether the joint estimate, instead of a track's own filter, is used for every target that it holds.

        It is used once the delay is known, while a constant mount explains the flight: each covariance includes the
        unobservable parameters at their priors. Before, it is used only where the flight contradicts a prior, because
        the tracks' own filters rest on that prior.
        """
        assessment = self.assessment
        if assessment is None or assessment.status is CalibrationStatus.WAITING:
            return bool(self.denied)
        return self.is_calibrated or assessment.constant

    @cached_property
    def mount_off(self) -> float:
        """Largest likely error of the configured mount, rad: the estimated correction plus two sigma of it."""
        means, sigmas = believed(self.assessment, self.context.shared_priors, self.stamp_sigma_s)
        return hypot(*(means[i] for i in MOUNT_AXES)) + 2.0 * max(sigmas[i] for i in MOUNT_AXES)

    def gate(self, track: int, fix: GroundFix) -> GateResult | None:
        """Gating statistics of a fix against a target of the joint estimate; None where it holds no such target."""
        present = self.present
        if present is None or track not in present.joint.tracks:
            return None
        return self.context.frame_of(fix).gate(fix, present.joint.tracks.index(track), present)

    def _lag_s(self) -> float:
        earliest = self.context.delays[0] if self.delay_s is None else self.delay_s
        return LAG_S + 0.5 * SPAN_S + max(0.0, -earliest)

    @property
    def _shown_delay_s(self) -> float:
        """Delay, s, if the flight shows it; otherwise 0, because a search misled by a wrong mount finds any delay."""
        shown = self.assessment is not None and SharedParameter.DELAY in self.assessment.parameters
        return self.delay_s or 0.0 if shown else 0.0

    def _state_at_capture(self, nominal: VehicleState) -> VehicleState:
        """The vehicle's state at a capture, corrected by the delay if the flight shows one."""
        if not self._shown_delay_s or self.context.state_at is None:
            return nominal
        state = self.context.state_at(BootNs(nominal.boot_ns - ns_from_s(self._shown_delay_s)))
        return nominal if isinstance(state, Unpaired) else state
