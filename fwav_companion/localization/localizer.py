"""Ground fixes: the intersection of a sighting's ray with the ground, its covariance and its error budget."""

from __future__ import annotations

from math import hypot, isfinite, sqrt

import msgspec

from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.vectors import Vector3, cross, dot, norm, scale, transform, unit
from fwav_companion.localization.covariance import (
    BiasVariances,
    ErrorModel,
    NoiseVariances,
    bias_variances,
    noise_variances,
)
from fwav_companion.localization.ground import LEVEL_NORMAL, Ground, Intersection, lowered
from fwav_companion.localization.ground_profile import turned_aside, turned_up
from fwav_companion.localization.ground_shape import (
    MOST_REACH,
    MOST_TURN,
    NEEDED_TURNS,
    SIDE_SIGMAS,
    SIDE_WEIGHT,
    TURN_SIGMAS,
    RayOnSurface,
    level_scatter_m,
)
from fwav_companion.localization.propagation import Propagation, RangeSensitivity, propagate
from fwav_companion.localization.size_height import SizeHeights
from fwav_companion.localization.terrain_ground import TerrainGround
from fwav_companion.types import (
    Bias,
    ErrorPriors,
    GimbalAt,
    GroundFix,
    NoFix,
    Reason,
    Sighting,
    TakeOff,
    VehicleState,
)

LARGEST_STRETCH = 0.15
"""Largest one sigma of the relative error of the ray's length by all angle errors; beyond it a fix is refused as too
shallow.

Let k be this number. The error is then e (1 - k z + ...) for a normal z, instead of e. Its mean is off by at most k
sigma along the ray, and its mean normalised square is 1 + 3 k^2, at most 7 % too large. So the bias by curvature is
bounded by 0.15 of the claimed sigma, and a claimed 90 % ellipse still contains 88 %. For 1.2 degrees of angle error in
all, the bound is a descent of 8 degrees below the horizon."""

LEAST_HEIGHT_M = 0.02
"""Least height above a pad, or a tag of known size, at which fixes are made, metres."""
LEAST_TILT = 1e-3
"""Angle of the ray to the ground's normal, radians, below which no ridge can hide another."""
LEVEL_GROUNDS = ("home", "fixed")
"""Models whose ground may be uneven by [uncertainty] terrain_m; a rangefinder measures it."""
WALL = 0.7
"""Down component of a normal below which the surface is steeper than 45 deg: a wall or the side of a tree, where the
ground about it matters."""
UPRIGHT: Vector3 = unit((0.0, 0.0, 1.0))
"""Normal of ground that is level on average; not :data:`LEVEL_NORMAL`, whose points lie exactly at its level."""


class Localizer:
    """Converts sightings to fixes on one ground model. The only state is that of the ground."""

    def __init__(self, ground: Ground, priors: ErrorPriors, *, min_height_m: float) -> None:
        """``min_height_m`` does not apply to pads and tags whose size shows the height."""
        self.ground = ground
        self._priors = priors
        self._min_height_m = min_height_m
        self._size_heights = SizeHeights(priors)
        self._bias = bias_variances(priors)
        self._uneven = priors.sigma(Bias.TERRAIN) > 0.0

    def home_moved(self, home_down_m: float) -> None:
        """Set the home surface to ``home_down_m`` below the world's origin, metres."""
        self.ground.home_moved(home_down_m)

    def on_origin(self, plane: TangentPlane, take_off: TakeOff, undulation_m: float | None) -> str:
        """Set the world's origin, the take-off place and the geoid undulation; the notice for people, or ""."""
        return self.ground.on_origin(plane, take_off, undulation_m)

    def locate(self, sighting: Sighting) -> GroundFix | NoFix:
        """The ground fix of a sighting, or the reason for its refusal.

        In a relative world the origin of the fix is the point below the camera.
        """
        try:
            answer = self._located(sighting)
        except (OverflowError, ValueError, ZeroDivisionError):  # finite but absurd telemetry
            return NoFix(Reason.NOT_FINITE)
        if isinstance(answer, GroundFix) and not _is_finite(answer):
            return NoFix(Reason.NOT_FINITE)
        return answer

    def _located(self, sighting: Sighting) -> GroundFix | NoFix:
        direction = transform(sighting.ned_from_camera, sighting.ray.direction)
        meeting, fused = self._meet(sighting, direction), None
        if sighting.size_height is not None:
            meeting, fused = self._size_heights.meet(sighting, direction, meeting, size=sighting.size_height)
        if isinstance(meeting, NoFix):
            return meeting
        least_m = self._min_height_m if fused is None else LEAST_HEIGHT_M
        if not meeting.height_m >= least_m:
            return NoFix(Reason.TOO_LOW)
        if self._uneven and meeting.ground in LEVEL_GROUNDS:
            meeting = msgspec.structs.replace(meeting, uneven=True)
        propagation, sensitivity = propagate(sighting, direction, meeting)
        noise = noise_variances(sighting, meeting, self._priors)
        stretch = sqrt(self._stretch_variance(sensitivity, noise))
        if meeting.surveyed and not stretch <= LARGEST_STRETCH and meeting.normal[2] < WALL:
            meeting = msgspec.structs.replace(meeting, normal=UPRIGHT)
            propagation, sensitivity = propagate(sighting, direction, meeting)
            stretch = sqrt(self._stretch_variance(sensitivity, noise))
        if not stretch <= LARGEST_STRETCH:
            return NoFix(Reason.TOO_SHALLOW)
        if meeting.surveyed:
            rough_m = self._roughness_m(sighting, direction, meeting, self._reach(direction, meeting, stretch))
            if isinstance(rough_m, NoFix):
                return rough_m
            propagation = self._with_level_doubt(propagation, hypot(meeting.level_doubt_m, rough_m))
        state = sighting.state
        by_home = meeting.ground == "home"  # the other grounds are not known by the vehicle's height above home
        height_bias_m = state.height_bias_m if by_home else None
        if fused is not None:
            height_bias_m = fused.bias_m
        tilt = self._tilt_sigma(state)
        variances = self._variances(state.position_bias_m, height_bias_m, tilt)
        errors = ErrorModel(propagation, noise, variances, meeting)
        return GroundFix(
            sighting=sighting,
            position_ned=_point(meeting, direction),
            noise_cov=errors.noise_cov,
            bias_jacobian=self._by_sensor(state.position_bias_m, height_bias_m, tilt, propagation.biases),
            errors=errors,
            ground=meeting.ground,
            level_sigma_m=errors.level_sigma_m,
            best_height_m=None if fused is None else fused.height_m,
        )

    def _meet(self, sighting: Sighting, direction: Vector3) -> Intersection | NoFix:
        """The intersection of the ray with the ground, which is raised by the height of a detected point above its
        foot.

        The camera is lowered instead of raising the ground, so that the intersection is the target's foot: after the
        intersection with level ground, whatever shows the height of that ground; before it over an elevation model.
        """
        raised_m = sighting.anchor_height_m
        meeting = self.ground.meet(sighting, direction)
        if raised_m == 0.0 or isinstance(meeting, NoFix):
            return meeting
        if meeting.normal is LEVEL_NORMAL:
            return lowered(meeting, raised_m)
        return self.ground.meet(self._lowered(sighting), direction)

    def _stretch_variance(self, stretch: RangeSensitivity, noise: NoiseVariances) -> float:
        """The variance of the relative error of the ray's length by all errors that turn the ray."""
        bias, (x, y, z), (u, v) = self._bias, stretch.body, stretch.pixel
        heading, time, attitude = stretch.heading, stretch.time, noise.attitude + noise.bridging
        return (
            x * x * (bias.roll + bias.mount_x + attitude)
            + y * y * (bias.pitch + bias.mount_y + attitude)
            + z * z * (bias.mount_z + noise.bridging)
            + heading * heading * (bias.heading + noise.attitude)
            + u * u * noise.pixel_u
            + v * v * noise.pixel_v
            + time * time * (bias.time_offset + noise.readout_share * bias.readout + noise.time)
        )

    def _reach(self, direction: Vector3, meeting: Intersection, stretch: float) -> float:
        """One sigma of the relative length of turned rays whose ends cover where, by all errors, this ray may end.

        An error of the ground's level moves the end along the ground by the error times the tangent of the tilt. A turn
        of the ray with the same effect changes its length by the square of the sine as much as the level error does.
        """
        level_m2 = meeting.level_doubt_m**2 + self._bias.terrain + self._bias.height
        descent = dot(meeting.normal, direction)
        level = meeting.normal[2] * sqrt(level_m2) / (descent * meeting.distance_m)
        return min(MOST_REACH, hypot(stretch, (1.0 - descent**2) * level))

    def _by_sensor(
        self, position_m: float | None, height_m: float | None, tilt: float | None, columns: tuple[Vector3, ...]
    ) -> tuple[Vector3, ...]:
        """The columns of the biases; those of the position, of the height and of roll and pitch are scaled by the
        sensor's own sigma over the prior's.
        """
        scaled: list[Vector3] | None = None
        for sigma, biases in (
            (position_m, (Bias.POSITION_NORTH, Bias.POSITION_EAST)),
            (height_m, (Bias.HEIGHT,)),
            (tilt, (Bias.ROLL, Bias.PITCH)),
        ):
            prior = self._priors.sigma(biases[0])
            if sigma is None or sigma == prior or prior == 0.0:
                continue
            scaled = scaled or list(columns)
            for bias in biases:
                scaled[bias] = scale(columns[bias], sigma / prior)
        return columns if scaled is None else tuple(scaled)

    def _tilt_sigma(self, state: VehicleState) -> float | None:
        """One sigma of roll and pitch where the gimbal's message adds to the configured one; else None."""
        further = state.gimbal.tilt_sigma if isinstance(state.gimbal, GimbalAt) else 0.0
        return hypot(self._priors.sigma(Bias.ROLL), further) if further else None

    def _variances(self, position_m: float | None, height_m: float | None, tilt: float | None) -> BiasVariances:
        """The variances of the biases, those of position, height, roll and pitch by the sensor's own sigma if known."""
        variances = self._bias
        if tilt is not None and self._priors.sigma(Bias.ROLL):
            variances = msgspec.structs.replace(variances, roll=tilt * tilt, pitch=tilt * tilt)
        if position_m is not None:
            variances = msgspec.structs.replace(variances, north=position_m * position_m, east=position_m * position_m)
        if height_m is not None and self._priors.sigma(Bias.HEIGHT):
            variances = msgspec.structs.replace(variances, height=height_m * height_m)
        return variances

    def _with_level_doubt(self, propagation: Propagation, doubt_m: float) -> Propagation:
        """The propagation with an uncertainty of the ground's level in addition to [uncertainty] terrain_m.

        The column of the terrain is scaled by the ratio of both sigmas together to the prior: one bias through the
        flight.
        """
        prior_m = self._priors.sigma(Bias.TERRAIN)
        if doubt_m == 0.0 or prior_m == 0.0:
            return propagation
        columns = list(propagation.biases)
        columns[Bias.TERRAIN] = scale(columns[Bias.TERRAIN], hypot(prior_m, doubt_m) / prior_m)
        return msgspec.structs.replace(propagation, biases=tuple(columns))

    def _roughness_m(
        self, sighting: Sighting, direction: Vector3, meeting: Intersection, reach: float
    ) -> float | NoFix:
        """One sigma of the ground's level, metres, that represents the ground's shape about the point in the
        covariance.

        The ray's angle in its vertical plane is normal, and one walk along the ground gives the distance of the ground
        at each angle: their scatter about the distances on a plane is integrated. An edge near the ray makes two
        groups of distances. One claim can hold both where it holds every place within EDGE_SIGMAS; otherwise the
        answer is refused. To the sides three rays suffice.
        """
        descent = dot(meeting.normal, direction)
        tilt = norm(cross(direction, meeting.normal)) / descent
        if tilt < LEAST_TILT or not isinstance(self.ground, TerrainGround):
            return 0.0
        by_place = sqrt(self._bias.north) * direction[2] / meeting.distance_m
        sigma = min(hypot(reach / tilt, by_place), MOST_TURN)
        low = self._lowered(sighting)
        distances = self.ground.turned_distances(low, direction, [sigma * each for each in TURN_SIGMAS])
        if distances is None:
            return 0.0
        if len(distances) < NEEDED_TURNS:
            return self._beyond(low, turned_up(direction, TURN_SIGMAS[NEEDED_TURNS - 1] * sigma))
        level_m = level_scatter_m(
            RayOnSurface(direction, meeting.normal, meeting.distance_m),
            sigma,
            distances,
            linear_m=reach * meeting.distance_m,
            side_m2=self._scatter_to_sides(low, direction, meeting, sigma),
        )
        return NoFix(Reason.TWO_GROUNDS) if level_m is None else level_m

    def _scatter_to_sides(self, sighting: Sighting, direction: Vector3, meeting: Intersection, sigma: float) -> float:
        """Variance of the distance about that on a plane by turns to the sides, m^2: the heading's error, too."""
        sigma = hypot(sigma, hypot(direction[0], direction[1]) * sqrt(self._bias.heading))
        variance, ray = 0.0, RayOnSurface(direction, meeting.normal, meeting.distance_m)
        for side in (-SIDE_SIGMAS * sigma, SIDE_SIGMAS * sigma):
            turned = turned_aside(direction, side)
            other = self.ground.meet(sighting, turned)
            if isinstance(other, Intersection):
                variance += SIDE_WEIGHT * (other.distance_m - ray.planar_m(turned)) ** 2
        return variance

    def _lowered(self, sighting: Sighting) -> Sighting:
        """The sighting from a camera that is lower by the height of the detected point above its foot."""
        north, east, down = sighting.camera_ned
        raised_m = sighting.anchor_height_m
        return (
            sighting
            if raised_m == 0.0
            else msgspec.structs.replace(sighting, camera_ned=(north, east, down + raised_m))
        )

    def _beyond(self, sighting: Sighting, turned: Vector3) -> NoFix:
        """The reason why a ray that errors may lead to has no place on the model."""
        other = self.ground.meet(sighting, turned)
        if isinstance(other, NoFix):
            return NoFix(Reason.TOO_SHALLOW) if other.reason is Reason.ABOVE_HORIZON else other
        return NoFix(Reason.BEYOND_TERRAIN)


def _point(meeting: Intersection, direction: Vector3) -> Vector3:
    """The end of the ray, NED; on level ground exactly at its level."""
    (north, east, down), (d_n, d_e, d_d), distance_m = meeting.camera_ned, direction, meeting.distance_m
    deeper_m = meeting.height_m if meeting.normal is LEVEL_NORMAL else distance_m * d_d
    return (north + distance_m * d_n, east + distance_m * d_e, down + deeper_m)


def _is_finite(fix: GroundFix) -> bool:
    """Whether position and variances of a fix are finite; infinity or NaN in a column makes the variances so, too."""
    (north, east, down), (nn, _, _), (_, ee, _), (_, _, dd) = fix.position_ned, *fix.noise_cov
    total = north + east + down + nn + ee + dd
    for n, e, d in fix.bias_jacobian:
        total += n * n + e * e + d * d
    return isfinite(total)
