"""Schmidt-Kalman filter of a static target."""

from __future__ import annotations

from typing import Self

from msgspec.structs import replace

from fwav_companion.geometry.stamps import s_from_ns
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.tracking.filters.consider_biases import FIRST_SENSITIVITY_S, Measurement
from fwav_companion.tracking.filters.linearization import (
    LinearizationPoint,
    first_point,
    height_noise_m,
    is_level,
    level_columns,
)
from fwav_companion.tracking.filters.maneuver import JUMPED, ManeuverLag
from fwav_companion.tracking.filters.relative_estimate import relative_estimate
from fwav_companion.tracking.filters.schmidt_kalman import first_down, first_point_estimate, scattered
from fwav_companion.tracking.filters.standing import StandingModel, StandingTargetState, apart_at
from fwav_companion.types import ErrorPriors, GroundFix

OWN_RAY = 0.05
"""Ratio of the noise of one reported position to the height, beyond which sensitivities are taken at the ray of the fix
and not at the linearization point. From 1 m of height, 0.1 m turns the line to that point by 6 degrees, and a height
bias of 0.5 m then seems to move the target: where a position erred by 0.3 m, the place relative to the vehicle was
0.2 m off with a sigma of 0.055 m. The noise of the ray itself, 0.1 degrees of attitude, is small there."""


class StaticTargetState(StandingTargetState, frozen=True, kw_only=True, gc=False):
    """State of a static target. The gain of least total covariance prefers near fixes, as their biases are smaller."""

    point: LinearizationPoint
    """Point at which sensitivities are evaluated."""
    jump: ManeuverLag = ManeuverLag()
    """Running mean of the innovations, which shows a jump of the vehicle's position."""

    def update(self, fix: GroundFix) -> Self:
        """The state after a fix of this instant."""
        since_s = s_from_ns(fix.sighting.frame_host_ns - self.fixed_ns)
        return self.under(self.model.wander_at(fix))._updated(fix, since_s)

    def measured(self, fix: GroundFix) -> Measurement:
        """The measurement that :meth:`update` makes of a fix of this instant."""
        return self._measured(fix, s_from_ns(fix.sighting.frame_host_ns - self.fixed_ns))[1]

    def _updated(self, fix: GroundFix, since_s: float) -> Self:
        errors, host_ns = self.model.errors, fix.sighting.frame_host_ns
        point, measurement, noise = self._measured(fix, since_s)
        before = self.before(host_ns)
        innovation = before.innovation(measurement)
        jump = self.jump.with_fix(innovation.north_m, innovation.east_m, since_s)
        state = self
        if self.wander.sigma_m > 0.0 and jump.is_turn(innovation.cov, JUMPED):
            # The vehicle's position has certainly jumped: its variance grows by the square of the mean innovation.
            (nn, ne, _), (_, ee, _), _ = jump.position_cov
            before, jump = before.with_noise((nn, ne, ee)), ManeuverLag()
            if self.wandering is not None:
                state = replace(self, wandering=self.wandering.with_jump(0.5 * (nn + ee)))
            innovation = before.innovation(measurement)
        apparent = before.update(innovation, innovation.gain)
        wandering, fresh, placed_ns, evidence = state.placed(measurement, noise, host_ns)
        down, late = self.down.update(measurement), errors.by_delay(measurement)
        report_m2 = errors.priors.position_noise_m**2
        now = relative_estimate(
            before, innovation, fix.noise_cov, position_noise_m2=report_m2, by_delay=late, down=down.shared
        )
        return replace(
            state,
            apparent=apparent,
            predicted=apparent,
            wandering=wandering,
            wander_evidence=evidence,
            fresh=fresh,
            placed_ns=placed_ns,
            jump=jump,
            down=down,
            scatter=scattered(before, self.scatter, errors.prepared(fix), errors.timed),
            point=point,
            now=now,
            late=late,
            fixed_ns=host_ns,
            host_ns=host_ns,
        )

    def _measured(self, fix: GroundFix, since_s: float) -> tuple[LinearizationPoint, Measurement, Matrix3]:
        """The linearization point after a fix, the measurement with sensitivities there, and the fix's own noise."""
        errors, apparent = self.model.errors, self.apparent
        measurement = errors.decorrelated(fix, since_s, (apparent.north_m, apparent.east_m, self.down.down_m))
        if not is_level(fix):
            return self.point, errors.at_own_ray(measurement, fix, since_s), measurement.noise
        (fix_n, fix_e, _), (camera_n, camera_e, _) = fix.position_ned, fix.sighting.camera_ned
        height_m, priors = fix.height_above_target_m, errors.priors
        point = self.point.with_fix(height_m, fix_n, fix_e, interval_s=since_s, sigma_m=height_noise_m(fix, priors))
        if priors.position_noise_m**2 > (OWN_RAY * point.height_m) ** 2:
            scale = point.height_m / height_m
            toward_n, toward_e = scale * (fix_n - camera_n), scale * (fix_e - camera_e)
        else:
            toward_n, toward_e = point.north_m - camera_n, point.east_m - camera_e
        columns = level_columns(fix, toward_n, toward_e, point.height_m)
        return point, errors.relinearized(measurement, fix, columns, since_s), measurement.noise


class StaticKalman:
    """Initiates static targets."""

    __slots__ = ("model",)

    def __init__(self, priors: ErrorPriors) -> None:
        self.model = StandingModel(priors)

    def initiate(self, fix: GroundFix) -> StaticTargetState:
        """The state after the first fix: the fix itself."""
        model, host_ns = self.model, fix.sighting.frame_host_ns
        measurement = model.errors.at_own_ray(model.errors.prepared(fix), fix, FIRST_SENSITIVITY_S)
        apparent, wander = first_point_estimate(measurement), model.wander_at(fix)
        return StaticTargetState(
            model=model,
            wander=wander,
            apparent=apparent,
            predicted=apparent,
            down=first_down(measurement),
            point=first_point(fix, height_noise_m(fix, model.errors.priors)),
            apart_ns=apart_at(fix),
            placed_ns=host_ns,
            fixed_ns=host_ns,
            host_ns=host_ns,
        )
