"""A track's target as it is reported: by its own filter or by the joint estimate of self-calibration.

While the mount is known to be wrong, reports have a larger covariance (``misplaced``).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import inf
from typing import TYPE_CHECKING, ClassVar

import msgspec

from fwav_companion.geometry.small_matrices import Symmetric2, add_diagonal, horizontal_sigma
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.tracking.filters.base import TargetEstimate, TargetState
from fwav_companion.tracking.filters.standing import StandingTargetState
from fwav_companion.tracking.track_state import LiveTrack
from fwav_companion.types import FrameView, GroundFix, Track, VehicleState
from fwav_companion.types.tracks import GateResult

if TYPE_CHECKING:
    from fwav_companion.self_calibration.calibrated_fix import CalibratedFix
    from fwav_companion.self_calibration.calibrated_places import CalibratedPlace
    from fwav_companion.self_calibration.calibrator import Calibrator


class CalibratedTargetState(msgspec.Struct, frozen=True, dict=True):
    """A target by the joint estimate of self-calibration; its height is by its own filter."""

    calibrator: Calibrator
    track: int
    placed: CalibratedPlace
    own: TargetState
    by_fix: CalibratedFix | None = None
    """The target by its fix of this frame, where that is better: a fix has error and delay of the vehicle's report."""
    vehicle: VehicleState | None = None
    """The vehicle's report at a frame without a fix of this target."""
    velocity_ned: ClassVar[None] = None
    velocity_cov: ClassVar[None] = None

    @property
    def position_ned(self) -> Vector3:
        """Position in NED, metres."""
        return (self.placed.north, self.placed.east, self.own.position_ned[2])

    @property
    def cov(self) -> Matrix3:
        """Covariance of the position by every source of error, NED, m^2."""
        return _level(self.placed.cov, self._down_variance)

    @property
    def apparent_ned(self) -> Vector3:
        """Position in the frame of the vehicle's report, NED, metres."""
        place, in_report = self.placed, self._in_report
        if in_report is not None:
            return (in_report.north, in_report.east, self.position_ned[2])
        return (place.apparent_north, place.apparent_east, self.position_ned[2])

    @property
    def relative_cov(self) -> Matrix3:
        """Covariance of the target relative to the vehicle, NED, m^2."""
        if self._in_report is not None:
            return _level(self._in_report.cov, self._down_variance)
        return _level(place_cov(self.calibrator, self.placed, self.own), self._down_variance)

    @cached_property
    def _in_report(self) -> CalibratedFix | None:
        """The target in the frame of the vehicle's report; None where only its apparent place is known."""
        if self.by_fix is not None or self.vehicle is None:
            return self.by_fix
        return self.calibrator.in_report(self.track, self.vehicle)

    @cached_property
    def _down_variance(self) -> float:
        return self.own.cov[2][2]

    def gate(self, fix: GroundFix) -> GateResult:
        """Gating statistics of a fix by the joint estimate; by the own filter where the joint estimate has none."""
        seen = self.calibrator.gate(self.track, fix)
        return self.own.gate(fix) if seen is None else seen

    def separation2(self, other: int) -> float:
        """Squared Mahalanobis distance to the target of another track, 2 degrees of freedom; inf where unknown."""
        served = self.calibrator.passes.served
        return inf if served is None else served.best.separation2(self.track, other)


def place_cov(calibrator: Calibrator, placed: CalibratedPlace, own: TargetState) -> Symmetric2:
    """Horizontal covariance of an apparent place relative to the vehicle, m^2, with noise and delay of its report."""
    noise, (nn, ne, ee) = calibrator.context.priors.position_noise_m**2, placed.relative_cov
    if isinstance(own, StandingTargetState) and calibrator.assessment is not None and own.late:
        late = own.report_lateness(calibrator.assessment.position_delay_share)
        nn, ne, ee = nn + late[0], ne + late[1], ee + late[2]
    return (nn + noise, ne, ee + noise)


class TargetChoice(msgspec.Struct, frozen=True):
    """The choice between the joint estimate and the tracks' own filters, at one instant."""

    calibrator: Calibrator | None
    """None without self-calibration."""
    corrects: Calibrator | None
    """The same where it may correct the tracks, otherwise None."""
    landmarks_show: bool
    """Whether landmarks corrected the tracks' own filters."""
    vehicle: VehicleState | None = None
    """The vehicle's report at this instant; None where it is not known."""

    def calibrated(self, track: LiveTrack) -> CalibratedTargetState | None:
        """The target by the joint estimate; None where that does not hold the target or may not correct it."""
        calibrator = self.corrects
        placed = None if calibrator is None else calibrator.placed(track.id)
        if calibrator is None or placed is None:
            return None
        if track.fix is None:
            return CalibratedTargetState(calibrator, track.id, placed, track.target, vehicle=self.vehicle)
        nn, _, ee = place_cov(calibrator, placed, track.target)
        by_fix = calibrator.by_fix(track.id, track.fix, nn + ee)
        return CalibratedTargetState(calibrator, track.id, placed, track.target, by_fix)

    def gated(self, track: LiveTrack) -> TargetState:
        """The target that gates fixes in the association: that of its own filter."""
        return track.target

    def target(self, track: LiveTrack) -> TargetEstimate:
        """The target by the joint estimate where that answers (``CalibrationState.answers``), else by its own filter.

        The two covariances are not compared. Before the delay is known, the joint estimate weighs fixes by their noise
        alone. After that, the own filter rests on the priors of delay and mount, and its covariance may shrink below
        that of the joint estimate. A filter that rests on a prior which the flight contradicts is not used. Where
        landmarks corrected the own filter, the covariances are compared, because both then rest on the flight.
        """
        calibrator = self.calibrator
        if calibrator is None or not calibrator.answers:
            return track.target
        calibrated = self.calibrated(track)
        if calibrated is None:
            return track.target
        by_landmarks = self.landmarks_show and not calibrator.denied
        if by_landmarks and horizontal_sigma(track.target.cov) < horizontal_sigma(calibrated.cov):
            return track.target
        return calibrated

    def reports(self, tracks: Sequence[LiveTrack], view: FrameView) -> tuple[Track, ...]:
        """The tracks' reports, without branches."""
        reports = tuple([track.report(self.target(track), view) for track in tracks if track.id > 0])
        misplaced_m = 0.0 if self.calibrator is None else self.calibrator.misplaced_m
        return reports if misplaced_m == 0.0 else tuple([misplaced(report, misplaced_m) for report in reports])


def misplaced(report: Track, sigma_m: float) -> Track:
    """The report while the mount is known to be wrong: with a larger covariance, without a fix and without a velocity.

    A wrong mount shifts the place in a direction that turns, so the target's own motion is not known. ``sigma_m``: one
    sigma an axis, horizontal.
    """
    variance = sigma_m**2
    return msgspec.structs.replace(
        report,
        cov=add_diagonal(report.cov, variance, 0.0),
        relative_cov=add_diagonal(report.relative_cov, variance, 0.0),
        velocity_ned=None,
        velocity_cov=None,
        fix=None,
        innovation=None,
    )


def _level(horizontal: Symmetric2, down: float) -> Matrix3:
    nn, ne, ee = horizontal
    return ((nn, ne, 0.0), (ne, ee, 0.0), (0.0, 0.0, down))
