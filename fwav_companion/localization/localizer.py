"""Ground fixes: the intersection of a sighting's ray with the ground, its covariance and its error budget."""

from __future__ import annotations

from math import isfinite, sqrt

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.rotations import exp, rotate
from fwav_companion.geometry.vectors import Vector3, add, cross, dot, norm, scale, transform
from fwav_companion.localization.covariance import ErrorModel, NoiseVariances, bias_variances, noise_variances
from fwav_companion.localization.ground import LEVEL_NORMAL, Ground, Intersection
from fwav_companion.localization.propagation import Propagation, propagate
from fwav_companion.types import ErrorPriors, GroundFix, NoFix, Reason, Sighting

LARGEST_STRETCH = 0.15
"""Largest one sigma of the ray's relative length by all angle errors; beyond it a fix is refused as too shallow.

Let k be this number. The error is then e (1 - k z + ...) for a normal z, instead of e. Its mean is off by at most k
sigma along the ray, and its mean normalised square is 1 + 3 k^2, at most 7 % too large. So the bias by curvature is
bounded by 0.15 of the claimed sigma, and a claimed 90 % ellipse still contains 88 %. For 1.2 degrees of angle error in
all, the bound is a descent of 8 degrees below the horizon."""

LEAST_TILT = 1e-3
"""Angle of the ray to the ground's normal, radians, below which no ridge can hide another."""


class Localizer:
    """Localizer over one ground model; without state but that of the ground."""

    def __init__(self, ground: Ground, priors: ErrorPriors, *, min_height_m: float) -> None:
        self.ground = ground
        self._priors = priors
        self._min_height_m = min_height_m
        self._bias = bias_variances(priors)

    def home_moved(self, home_down_m: float) -> None:
        """Set the home surface to ``home_down_m`` below the world's origin, metres."""
        self.ground.home_moved(home_down_m)

    def placed(self, plane: TangentPlane, take_off: Geodetic, undulation_m: float | None) -> str:
        """Set the world's origin, the take-off place and the geoid undulation; the notice for people, or ""."""
        return self.ground.placed(plane, take_off, undulation_m)

    def locate(self, sighting: Sighting) -> GroundFix | NoFix:
        """The ground fix of a sighting, in a relative world about the point below the camera; or the reason why not."""
        try:
            answer = self._located(sighting)
        except (OverflowError, ValueError, ZeroDivisionError):  # finite but absurd telemetry
            return NoFix(Reason.NOT_FINITE)
        if isinstance(answer, GroundFix) and not _is_finite(answer):
            return NoFix(Reason.NOT_FINITE)
        return answer

    def _located(self, sighting: Sighting) -> GroundFix | NoFix:
        direction = transform(sighting.ned_from_camera, sighting.ray.direction)
        meeting = self.ground.meet(sighting, direction)
        if isinstance(meeting, NoFix):
            return meeting
        if not meeting.height_m >= self._min_height_m:
            return NoFix(Reason.TOO_LOW)
        propagation = propagate(sighting, direction, meeting)
        noise = noise_variances(sighting, meeting, self._priors)
        stretch = sqrt(self._stretch_variance(propagation, noise))
        if not stretch <= LARGEST_STRETCH:
            return NoFix(Reason.TOO_SHALLOW)
        if meeting.surveyed and not self._is_smooth(sighting, direction, meeting, stretch):
            return NoFix(Reason.TOO_SHALLOW)
        errors = ErrorModel(propagation, noise, self._bias, meeting)
        return GroundFix(
            sighting=sighting,
            position_ned=_point(meeting, direction),
            noise_cov=errors.noise_cov,
            bias_jacobian=propagation.biases,
            errors=errors,
            ground=meeting.ground,
            level_sigma_m=errors.level_sigma_m,
        )

    def _stretch_variance(self, propagation: Propagation, noise: NoiseVariances) -> float:
        """The variance of the ray's relative length by every error that turns the ray."""
        bias, stretch = self._bias, propagation.stretch
        x, y, z = (s * s for s in stretch.body)
        u, v = stretch.pixel
        attitude = noise.attitude + noise.bridging
        return (
            x * (bias.roll + bias.mount_x + attitude)
            + y * (bias.pitch + bias.mount_y + attitude)
            + z * (bias.mount_z + noise.bridging)
            + stretch.heading**2 * (bias.heading + noise.attitude)
            + u * u * noise.pixel_u
            + v * v * noise.pixel_v
            + stretch.time**2 * (bias.time_offset + noise.readout_share * bias.readout + noise.time)
        )

    def _is_smooth(self, sighting: Sighting, direction: Vector3, meeting: Intersection, stretch: float) -> bool:
        """Whether rays two sigma steeper and shallower meet the ground where a plane would, to one sigma.

        They do not where a ridge or a step lies between. The error then has two modes, and an ellipse cannot describe
        it.
        """
        axis = cross(direction, meeting.normal)
        tilt = norm(axis) / dot(meeting.normal, direction)
        if tilt < LEAST_TILT:
            return True
        for sigmas in (-2.0, 2.0):
            turn = exp(scale(axis, sigmas * stretch / (tilt * norm(axis))))
            other = self.ground.meet(sighting, rotate(turn, direction))
            if isinstance(other, NoFix):
                return False
            plane_m = meeting.distance_m / (1.0 + sigmas * stretch)
            if abs(other.distance_m - plane_m) > stretch * meeting.distance_m:
                return False
        return True


def _point(meeting: Intersection, direction: Vector3) -> Vector3:
    """The end of the ray, NED; on level ground exactly at its level."""
    north, east, down = add(meeting.camera_ned, scale(direction, meeting.distance_m))
    return (north, east, meeting.camera_ned[2] + meeting.height_m if meeting.normal is LEVEL_NORMAL else down)


def _is_finite(fix: GroundFix) -> bool:
    """Whether position and variances are finite; an infinity or NaN in a column makes its variances so."""
    (north, east, down), (nn, _, _), (_, ee, _), (_, _, dd) = fix.position_ned, *fix.noise_cov
    total = north + east + down + nn + ee + dd
    for n, e, d in fix.bias_jacobian:
        total += n * n + e * e + d * d
    return isfinite(total)
