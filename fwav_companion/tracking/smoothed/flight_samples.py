"""Telemetry and ground fixes as the smoother's input. Times are seconds on the autopilot's clock.

Heights are those of the camera above the origin, or above the ground where the ground model counts from there.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

import numpy as np

from fwav_companion.estimation.errors import Array
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.estimation.range_readings import RangeReading
from fwav_companion.geometry.gimbal import heading_only
from fwav_companion.geometry.rotations import conjugate, matrix_from_quaternion, multiply, rotate
from fwav_companion.geometry.stamps import NS_PER_MS, BootNs, s_from_ns
from fwav_companion.geometry.vectors import Vector3, cross
from fwav_companion.tracking.smoothed.flight_clock import FlightClock
from fwav_companion.tracking.smoothed.sample_source import SampleSource
from fwav_companion.types import (
    Bias,
    ErrorPriors,
    FrameView,
    GimbalAt,
    GroundFix,
    GroundReference,
    HeightReference,
    RangeSample,
    Reason,
    ReportedGimbal,
    Unpaired,
    VehicleState,
)

GIMBAL_STEP_NS = 20 * NS_PER_MS
"""Interval of a gimbal's attitudes: it turns by 0.1 degrees within it at 5 degrees a second."""
RELATIVE_STEP_NS = 100 * NS_PER_MS
"""Interval of the heights without a position: that of the usual positions."""
LEAST_PLUMB = 0.5
"""Least down component of a rangefinder's beam: beyond 60 degrees of tilt it measures another place."""


class FlightSamples:
    """Hands each sample of the telemetry to the smoother once."""

    __slots__ = (
        "_attitude_ns",
        "_clock",
        "_first_ns",
        "_gimbal_ns",
        "_has_gimbal",
        "_lever_m",
        "_position_ns",
        "_priors",
        "_range_ns",
        "_relative",
        "_source",
        "level_m",
    )  # fmt: skip

    def __init__(
        self, source: SampleSource, clock: FlightClock, lever_m: Vector3, priors: ErrorPriors, *, has_gimbal: bool
    ) -> None:
        """``lever_m``: from the reported position to the camera, body axes, metres."""
        self._source, self._clock, self._lever_m = source, clock, lever_m
        self._priors, self._has_gimbal = priors, has_gimbal
        self.restart(relative=False)

    def restart(self, *, relative: bool) -> None:
        """Forget what was handed over: the next smoother takes all stored samples.

        ``relative``: there is no position; the world's origin goes with the vehicle, on the ground below it.
        """
        self._relative = relative
        self.level_m: float | None = None
        """Level of the ground by a rangefinder's first reading, metres above the origin."""
        self.rewind()

    def rewind(self) -> None:
        """Take the samples from their first one on: the autopilot's clock started again."""
        self._attitude_ns = self._position_ns = self._range_ns = self._gimbal_ns = BootNs(-1)
        self._first_ns: BootNs | None = None

    def feed(self, estimator: Estimator, reference: GroundReference, view: FrameView | None = None) -> None:  # noqa: ARG002
        """Hand over what came since. ``reference``: the source of heights."""
        for sample in self._source.attitudes_after(self._attitude_ns):
            estimator.add_attitude(self._clock.seconds(sample.boot_ns), sample.ned_from_body)
            self._attitude_ns = sample.boot_ns
            self._first_ns = self._first_ns or sample.boot_ns
        if self._has_gimbal:
            self._feed_gimbal(estimator)
        if self._relative:
            self._feed_heights(estimator, reference)
            return
        for boot_ns, jumped in self._source.positions_after(self._position_ns):
            if boot_ns > self._attitude_ns:
                break  # its attitude, which places the camera, is still to come
            self._position_ns = boot_ns
            # One from before the first attitude counts as of that instant, else the first frames have no position.
            state = self._source.state_at(max(boot_ns, self._first_ns or boot_ns))
            if isinstance(state, VehicleState):
                self._add(estimator, state, reference, reset=jumped)
        if reference.height is HeightReference.RANGE:
            self._feed_ranges(estimator)

    def _add(self, estimator: Estimator, state: VehicleState, reference: GroundReference, *, reset: bool) -> None:
        """Add the camera's position: the vehicle's, moved by the lever arm."""
        position, velocity = state.position_ned, state.velocity_ned
        if position is None or velocity is None:
            return
        north, east, down = rotate(state.ned_from_body, self._lever_m)
        v_north, v_east, v_down = rotate(state.ned_from_body, cross(state.rates, self._lever_m))
        height_m, climb_m_s = -position[2] - down, -velocity[2] - v_down
        if reference.height is HeightReference.CONSTANT:
            height_m, climb_m_s = reference.level_m, 0.0
        elif reference.height is HeightReference.TERRAIN_REPORT:
            if state.terrain_height_m is None:
                return
            height_m = state.terrain_height_m - down
        camera = np.array([position[0] + north, position[1] + east, height_m])
        moved = np.array([velocity[0] + v_north, velocity[1] + v_east, climb_m_s])
        estimator.add_position(self._clock.seconds(state.boot_ns), camera, moved, reset=reset)

    def _feed_heights(self, estimator: Estimator, reference: GroundReference) -> None:
        """Add the camera's heights in a world without a position: the camera stays above its origin."""
        if self._position_ns < 0:
            first = self._source.attitudes_after(BootNs(-1))
            self._position_ns = first[0].boot_ns if first else self._position_ns
        while 0 <= self._position_ns < self._attitude_ns:
            state = self._source.state_at(self._position_ns)
            if isinstance(state, VehicleState):
                self._add_height(estimator, state, reference)
            self._position_ns = BootNs(self._position_ns + RELATIVE_STEP_NS)

    def _add_height(self, estimator: Estimator, state: VehicleState, reference: GroundReference) -> None:
        height_m, climb_m_s = self._height_without_position(state, reference), 0.0
        if height_m is None:
            return
        if state.velocity_ned is not None and reference.height is not HeightReference.CONSTANT:
            climb_m_s = -state.velocity_ned[2]
        camera, velocity = np.array([0.0, 0.0, height_m]), np.array([0.0, 0.0, climb_m_s])
        estimator.add_position(self._clock.seconds(state.boot_ns), camera, velocity)

    def _height_without_position(self, state: VehicleState, reference: GroundReference) -> float | None:
        """Height of the camera above the ground, metres; None where it is not known."""
        if reference.height is HeightReference.CONSTANT:
            return reference.level_m
        lever_down_m = rotate(state.ned_from_body, self._lever_m)[2]
        if reference.height is HeightReference.RANGE and state.range is not None:
            beam = rotate(state.ned_from_body, state.range.beam_in_body)
            if beam[2] >= LEAST_PLUMB:
                return state.range.distance_m * beam[2] - lever_down_m
        above_m = state.height_above_home_m
        return None if above_m is None else above_m - lever_down_m

    def _feed_ranges(self, estimator: Estimator) -> None:
        for sample in self._source.ranges_after(self._range_ns):
            if sample.boot_ns > self._attitude_ns:
                break
            self._range_ns = sample.boot_ns
            state = self._source.state_at(sample.boot_ns)
            if isinstance(state, VehicleState) and state.position_ned is not None:
                self._add_range(estimator, sample, state, state.position_ned)

    def _add_range(self, estimator: Estimator, sample: RangeSample, state: VehicleState, position: Vector3) -> None:
        """Add a reading: the beam's depth, from the camera. Errors of the attitude tilt the beam."""
        beam = rotate(state.ned_from_body, sample.beam_in_body)
        if beam[2] < LEAST_PLUMB:
            return
        lever_down_m = rotate(state.ned_from_body, self._lever_m)[2]
        depth_m = sample.distance_m * beam[2]
        tilt = hypot(self._priors.sigma(Bias.ROLL), self._priors.attitude_noise)
        sigma_m = hypot(
            (sample.sigma_m or self._priors.height_noise_m) * beam[2],
            sample.distance_m * hypot(beam[0], beam[1]) * tilt,
        )
        foot = (position[0] + sample.distance_m * beam[0], position[1] + sample.distance_m * beam[1])
        if self.level_m is None:
            self.level_m = -position[2] - depth_m
        estimator.add_range(RangeReading(self._clock.seconds(sample.boot_ns), depth_m - lever_down_m, sigma_m), foot)

    def _feed_gimbal(self, estimator: Estimator) -> None:
        """Add the gimbal's attitudes in steps that are finer than its reports, interpolated as it turns: evenly.

        A polynomial through reports of 5 Hz would overshoot where a gimbal begins or ends a slew.
        """
        if self._gimbal_ns < 0:
            first = self._source.attitudes_after(BootNs(-1))
            self._gimbal_ns = first[0].boot_ns if first else self._gimbal_ns
        while 0 <= self._gimbal_ns < self._attitude_ns:
            found = self._source.gimbal_at(self._gimbal_ns)
            if found is Reason.STALE_GIMBAL:
                break  # the next report is still to come
            if isinstance(found, ReportedGimbal):
                self._add_gimbal(estimator, self._gimbal_ns, found)
            self._gimbal_ns = BootNs(self._gimbal_ns + GIMBAL_STEP_NS)

    def _add_gimbal(self, estimator: Estimator, boot_ns: BootNs, reported: ReportedGimbal) -> None:
        """Add an attitude. Its yaw counts as that of the first one: another zero is converted by the heading."""
        carrier, q = estimator.carrier, reported.attitude
        t = self._clock.seconds(boot_ns)
        if carrier.gimbal is not None and not len(carrier.gimbal):
            carrier.yaw_from_north = reported.from_north
        if carrier.yaw_from_north != reported.from_north:
            state = self._source.state_at(boot_ns)
            if isinstance(state, Unpaired):
                return
            heading = heading_only(matrix_from_quaternion(state.ned_from_body))
            q = multiply(conjugate(heading) if reported.from_north else heading, q)
        estimator.add_gimbal_attitude(t, q)


def sightings_of(
    number: int, fixes: Sequence[GroundFix], *, own_poses: bool = False, added_ns: int = 0
) -> Sightings | None:  # fmt: skip
    """The detections of a frame's fixes, in their order, without targets; None without a fix.

    ``own_poses``: the errors of the frame's pose are its own. ``added_ns``: to the frame's stamps (``FlightClock``).
    """
    if not fixes:
        return None
    rays, mounts, by_u, by_v, sigma, t, rows, own = [], [], [], [], [], [], [], []
    for fix in fixes:
        sighting = fix.sighting
        t.append(s_from_ns(sighting.boot_ns + added_ns))
        rows.append(sighting.row_fraction)
        mounts.append(sighting.body_from_camera)
        rays.append(sighting.ray.direction)
        by_u.append(sighting.ray.d_du)
        by_v.append(sighting.ray.d_dv)
        sigma.append(sighting.pixel_sigma)
        own.append(_own_noise(fix, own_poses=own_poses))
    mount = np.array(mounts)  # (D, 3, 3)
    count, columns = len(fixes), np.array([rays, by_u, by_v]).reshape(3, len(fixes), 3)
    ray, u, v = np.einsum("dij,cdj->cid", mount, columns)  # (3, D) each, carrier axes
    frame, none = np.full(count, number, np.int64), np.full(count, -1, np.int64)
    noise = np.array(own).T if np.any(own) else None
    return Sightings(np.array(t), ray, _tangents(u, v, np.array(sigma).T), frame, none, np.array(rows), noise)


def _own_noise(fix: GroundFix, *, own_poses: bool) -> tuple[float, float, float]:
    """One sigma of a frame's own pose: attitude, rad; north and east, up, metres.

    While both readings of a gimbal's tilt are possible, the frame's noise covers the other one: a target that begins by
    the wrong one would else be a second track later.
    """
    state = fix.sighting.state
    if not own_poses:
        gimbal = state.gimbal
        return (hypot(gimbal.sigma, gimbal.tilt_sigma) if isinstance(gimbal, GimbalAt) else 0.0), 0.0, 0.0
    level_m, up_m = state.position_sigma_m, state.height_sigma_m
    if fix.ground == "fixed":  # at a height below the camera: that of the camera does not count
        up_m = 0.0
    return state.carrier_sigma, level_m, level_m if up_m is None else up_m


def _tangents(u: Array, v: Array, sigma: Array) -> Array:
    """Rows (2, 3, D) from a direction to pixels over their sigma (2, D): a pseudo-inverse."""
    uu, uv, vv = (u * u).sum(0), (u * v).sum(0), (v * v).sum(0)
    rows = np.stack([vv * u - uv * v, uu * v - uv * u]) / (uu * vv - uv * uv)  # (2, 3, D)
    return np.asarray(rows / sigma[:, None])
