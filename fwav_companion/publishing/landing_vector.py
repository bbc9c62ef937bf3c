"""The vector of LANDING_TARGET (149), in the form that each autopilot reads, and the instant to which it is predicted.

Pure. ArduPilot takes a vector in the vehicle's body axes, and rotates it to the world by the attitude of ``PLND_LAG``
before the message's arrival: the prediction is made for that instant. PX4 takes a point in its own local frame, which
differs from the service's: the target relative to the vehicle is added to PX4's own position at the same instant, that
of the newest attitude. LOCAL_FRD is never sent: ArduPilot shipped it with the wrong sign of yaw.
"""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, hypot
from typing import Any, TypeAlias

from msgspec import structs

from fwav_companion.geometry.rotations import conjugate, exp, multiply, rotate
from fwav_companion.geometry.stamps import NS_PER_US, BootNs, HostNs, ns_from_s, s_from_ns
from fwav_companion.geometry.vectors import ZERO3, Vector3, add, norm, scale, subtract, transform
from fwav_companion.publishing import enums
from fwav_companion.types.sightings import GroundFix, Unpaired
from fwav_companion.types.situation import Situation
from fwav_companion.types.telemetry import VehicleState
from fwav_companion.types.tracks import Track

StateAt: TypeAlias = Callable[[BootNs], VehicleState | Unpaired]
"""Vehicle state at an instant of the autopilot's clock, or the reason why it is not known."""
MovedBetween: TypeAlias = Callable[[BootNs, BootNs], Vector3 | None]
"""The vehicle's way between two instants by its reported velocities, NED, metres; None where they are not known."""

MAX_BRIDGED_S = 0.1
"""Longest extrapolation of an attitude by its rates, seconds: half a beat at 5 Hz. Beyond it the extrapolation does not
hold for a flapping body."""
MEAN_S = 0.1
"""Longest time over which the mean of two velocities is the way: one interval of the usual stream of positions."""
LEAST_SIDEWAYS = 1e-6
"""Horizontal part of a unit ray below which it is only rounding."""


def state_when_used(situation: Situation, lag_s: float, state_at: StateAt | None) -> VehicleState | None:
    """Vehicle state at (arrival - ``lag_s``), from the history, else extrapolated from the newest state.

    None where the newest attitude is too old. The attitude's sigma contains the extrapolation.
    """
    newest, clock = situation.vehicle, situation.clock
    if newest is None or clock is None:
        return newest
    transit_s = 0.5 * clock.round_trip_s if clock.round_trip_s is not None else 0.0
    boot_now_ns = situation.now_ns - clock.host_from_autopilot_ns
    used_ns = BootNs(boot_now_ns + ns_from_s(transit_s - lag_s))
    step_s = s_from_ns(used_ns - newest.boot_ns)
    if not step_s <= MAX_BRIDGED_S:
        return None
    known = state_at(used_ns) if state_at is not None else None
    if isinstance(known, VehicleState):
        return known
    return _predicted_state(newest, step_s) if step_s >= -MAX_BRIDGED_S else None


def relative_to_vehicle(
    track: Track, fix: GroundFix | None, state: VehicleState, camera_position_m: Vector3
) -> Vector3 | None:
    """Vector from the vehicle to the target at the instant of ``state``, NED, metres; None without a known height.

    ``fix``: the target's last one. A target that moves is predicted by its velocity, either way in time.
    """
    target = track.apparent_ned
    if track.velocity_ned is not None:
        target = add(target, scale(track.velocity_ned, s_from_ns(state.boot_ns - track.boot_ns)))
    if state.position_ned is not None:
        return subtract(target, state.position_ned)
    height_m = None if fix is None else _camera_height(fix, state)
    if height_m is None:
        return None
    from_camera = (target[0], target[1], target[2] + height_m)
    return add(from_camera, rotate(state.ned_from_body, camera_position_m))


def by_fix(fix: GroundFix, track: Track, state: VehicleState, camera_position_m: Vector3, moved_m: Vector3) -> Vector3:
    """The vector from the vehicle to the landing point by one fix alone, NED, metres: the target minus the vehicle at
    the fix, less ``moved_m``, what the vehicle has moved since, and with what the target has.
    """
    before = fix.sighting.state
    age_s = s_from_ns(state.boot_ns - before.boot_ns)
    if fix.sighting.relative or before.position_ned is None:  # from the point below the camera
        relative = add(fix.position_ned, rotate(before.ned_from_body, camera_position_m))
    else:
        relative = subtract(fix.position_ned, before.position_ned)
    relative = subtract(relative, moved_m)
    if track.velocity_ned is not None:
        relative = add(relative, scale(track.velocity_ned, age_s))
    return at_landing_point(relative, fix, state, camera_position_m, moved_m)


def at_landing_point(
    relative_ned: Vector3, fix: GroundFix | None, state: VehicleState, camera_position_m: Vector3, moved_m: Vector3
) -> Vector3:
    """The vector to a target's foot as one to the landing point, whose height a tag's size has measured in the fix.

    Since the fix the vehicle has moved by ``moved_m``: the noise of its reported height is not in the vector.
    """
    if fix is None or fix.best_height_m is None:
        return relative_ned
    arm_m = rotate(state.ned_from_body, camera_position_m)[2]
    return (relative_ned[0], relative_ned[1], fix.best_height_m + arm_m - moved_m[2])


def moved_since(fix: GroundFix | None, after: VehicleState, moved_between: MovedBetween | None) -> Vector3:
    """What the vehicle has moved since a fix by its velocities, NED, metres; zero where they are not known.

    All velocities in between count, once there are several: each alone has the noise of a report.
    """
    if fix is None:
        return ZERO3
    before = fix.sighting.state
    age_s = s_from_ns(after.boot_ns - before.boot_ns)
    if moved_between is not None and age_s > MEAN_S:
        moved_m = moved_between(before.boot_ns, after.boot_ns)
        if moved_m is not None:
            return moved_m
    known = [each for each in (before.velocity_ned, after.velocity_ned) if each is not None]
    return ZERO3 if not known else scale(add(known[0], known[-1]), 0.5 * age_s)


def in_body(relative_ned: Vector3, state: VehicleState) -> Vector3:
    """The vector in the body axes of ``state``, FRD."""
    return rotate(conjugate(state.ned_from_body), relative_ned)


def landing_fields(
    track: Track, instant_ns: HostNs, frame: int, point: Vector3, *, body_frd: Vector3
) -> dict[str, Any]:
    """Fields of the message: ``point`` in ``frame``, and its direction as angles of a camera that looks down."""
    forward, right, down = body_frd
    return {
        "time_usec": instant_ns // NS_PER_US,
        "target_num": track.id % 256,
        "frame": frame,
        "angle_x": atan2(right, down),
        "angle_y": atan2(-forward, down),
        "distance": norm(body_frd),
        "size_x": 0.0,
        "size_y": 0.0,
        "x": point[0],
        "y": point[1],
        "z": point[2],
        "q": (1.0, 0.0, 0.0, 0.0),
        "type": enums.LANDING_TARGET_TYPE_VISION_OTHER,
        "position_valid": 1,
    }


def _predicted_state(state: VehicleState, step_s: float) -> VehicleState:
    """The state extrapolated by ``step_s``, positive or negative, with constant rates and velocity.

    A body that turns to and fro leaves its tangent by half of its acceleration times the time squared.
    """
    turned = multiply(state.ned_from_body, exp(scale(state.rates, step_s)))
    acceleration = norm(state.angular_acceleration) + state.turning_frequency * norm(state.rates)
    position = state.position_ned
    if position is not None and state.velocity_ned is not None:
        position = add(position, scale(state.velocity_ned, step_s))
    return structs.replace(
        state,
        boot_ns=BootNs(state.boot_ns + ns_from_s(step_s)),
        ned_from_body=turned,
        attitude_sigma=hypot(state.attitude_sigma, 0.5 * acceleration * step_s * step_s),
        position_ned=position,
    )


def _camera_height(fix: GroundFix, state: VehicleState) -> float | None:
    """Height of the camera above the ground under the target, in a world without a global position.

    The fix is then relative to the point below the camera, so its horizontal distance and the direction of its ray give
    the height. For a ray straight down they do not; then it is that by a tag's size, else the autopilot's above home.
    """
    north, east, down = transform(fix.sighting.ned_from_camera, fix.sighting.ray.direction)
    sideways = hypot(north, east)
    if sideways > LEAST_SIDEWAYS:
        return hypot(fix.position_ned[0], fix.position_ned[1]) / sideways * down
    size = fix.sighting.size_height
    return state.height_above_home_m if size is None else size.height_m
