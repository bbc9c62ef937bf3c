"""From a sighting to a point on the ground that says how certain it is and why."""

from __future__ import annotations

from math import isfinite, sqrt

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.rotations import exp, rotate
from fwav_companion.geometry.vectors import Vector3, add, cross, dot, norm, scale, transform
from fwav_companion.localization.covariance import NoiseVariances, bias_variances, fix_covariance, noise_variances
from fwav_companion.localization.ground import LEVEL_NORMAL, Ground, Intersection
from fwav_companion.localization.propagation import Propagation, propagate
from fwav_companion.types import ErrorPriors, GroundFix, NoFix, Reason, Sighting

LARGEST_STRETCH = 0.15
"""One sigma of the ray's relative length by all angles together, beyond which a fix is refused as too shallow.

With k this number the error is e (1 - k z + ...) for a normal z, instead of e: the mean lies off by at most k sigma
along the ray, and the mean normalised square is 1 + 3 k^2, at most 7 % too large. So the bias of convexity is bounded
by 0.15 of the claimed sigma, and a claimed 90 % ellipse still holds 88 %. With 1.2 degrees of angle in all, that is a
descent of 8 degrees below the horizon."""

LEAST_TILT = 1e-3
"""Of the ray against the ground's normal, radians: so near to it no ridge hides behind another."""


class Localizer:
    """Meets rays with one ground. Nothing is remembered but what the ground itself keeps."""

    def __init__(self, ground: Ground, priors: ErrorPriors, *, min_height_m: float) -> None:
        self.ground = ground
        self._priors = priors
        self._min_height_m = min_height_m
        self._bias = bias_variances(priors)

    def home_moved(self, home_down_m: float) -> None:
        """The home surface lies ``home_down_m`` below the world's origin from now on."""
        self.ground.home_moved(home_down_m)

    def placed(self, plane: TangentPlane, take_off: Geodetic, undulation_m: float | None) -> str:
        """The world has its origin, or the take-off place or the undulation is known better; what to tell, or ""."""
        return self.ground.placed(plane, take_off, undulation_m)

    def locate(self, sighting: Sighting) -> GroundFix | NoFix:
        """Where the sighting's ray meets the ground; in a relative world from the point below the camera."""
        try:
            answer = self._located(sighting)
        except (OverflowError, ValueError, ZeroDivisionError):  # telemetry that is finite but beyond all reason
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
        weights = fix_covariance(propagation, noise, self._bias, meeting)
        return GroundFix(
            sighting,
            _point(meeting, direction),
            weights.noise_cov,
            propagation.biases,
            weights.cov,
            weights.relative_cov,
            weights.budget,
            meeting.ground,
            weights.level_sigma_m,
        )

    def _stretch_variance(self, propagation: Propagation, noise: NoiseVariances) -> float:
        """Of the ray's relative length, by everything that turns the ray."""
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

        They do not where a ridge or a step lies between: the error then has two humps, and no ellipse tells it.
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
    """Where the ray ends; on level ground exactly at its level."""
    north, east, down = add(meeting.camera_ned, scale(direction, meeting.distance_m))
    return (north, east, meeting.camera_ned[2] + meeting.height_m if meeting.normal is LEVEL_NORMAL else down)


def _is_finite(fix: GroundFix) -> bool:
    """An infinity or a NaN anywhere in the columns makes a sum of squares that is none."""
    (north, east, down), (nn, _, _), (_, ee, _), (_, _, dd) = fix.position_ned, *fix.cov
    return isfinite(north + east + down + nn + ee + dd)
