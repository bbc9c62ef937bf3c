"""Claimed error of the vector that LANDING_TARGET carries: the target relative to the vehicle at the instant of the
prediction. Pure.

The tracker's covariance holds at the capture of the newest frame. The claim adds what is unknown since then: the motion
of target and vehicle over the age, the attitude at the instant of the prediction, and the autopilot's clock. An error
of the clock moves the target by the motion of its image: in a calm descent by nearly nothing, on a swinging body by
centimetres a millisecond.
"""

from __future__ import annotations

from math import hypot

from fwav_companion.geometry.rotations import rotate
from fwav_companion.geometry.small_matrices import scaled
from fwav_companion.geometry.vectors import ZERO3, Matrix3, Vector3, add, add_matrices, cross
from fwav_companion.publishing.target_report import larger_sigma
from fwav_companion.types.sightings import Bias, GroundFix
from fwav_companion.types.telemetry import VehicleState
from fwav_companion.types.tracks import Track

POSITION_DRIFT_M_S = 0.1
"""One sigma of the drift of the vehicle's reported position, m/s. PX4's estimate moved by 0.4 m in ten seconds near the
ground, and a receiver of 1 m that wanders over half a minute moves by 0.2 m in the first second and a half."""
UNKNOWN_SPEED_M_S = 1.0
"""One sigma of the vehicle's horizontal speed where no position shows it, m/s: a copter that is held by hand."""
MANEUVER_M_S2 = 1.0
"""One sigma of the unknown acceleration of a target that moves, m/s^2: a walker who turns around within two seconds."""


def is_nearer(fix: GroundFix, track: Track) -> bool:
    """Whether the last fix of a pad, or of a tag of known size, claims less than its track, and is to be landed on.

    Low over a pad one picture shows where it is to centimetres. In the track, and in its difference to the reported
    position now, is the noise of the reported positions; in the fix minus its own camera it is not.
    """
    if fix.best_height_m is None:
        return False
    if fix.sighting.relative:  # a track that is still relative to a vehicle that moves is where the pad was
        return True
    return larger_sigma(fix.relative_cov) < larger_sigma(track.relative_cov)


def landing_sigma_m(track: Track, cov: Matrix3, state: VehicleState, *, age_s: float) -> float:
    """One sigma of the target relative to the vehicle, larger semi-axis, metres; NaN where it is not known.

    ``cov``: at the capture, of the track or of the fix that is landed on; ``state``: the vehicle at the instant of the
    prediction; ``age_s``: time from the capture to that instant.
    """
    maneuver_m = 0.0
    if track.velocity_cov is not None:
        cov = add_matrices(cov, scaled(track.velocity_cov, age_s * age_s))
        maneuver_m = 0.5 * MANEUVER_M_S2 * age_s * age_s
    drift_m_s = UNKNOWN_SPEED_M_S if state.position_ned is None else POSITION_DRIFT_M_S
    return hypot(larger_sigma(cov), maneuver_m, drift_m_s * age_s, state.position_sigma_m)


def image_motion_m_s(fix: GroundFix | None, state: VehicleState | None, relative_ned: Vector3) -> float:
    """Speed at which the target moves in the image, projected to the target, m/s: metres a second of clock error.

    It is the larger of the speed at the capture of ``fix`` and, where the autopilot rotates the vector by its attitude,
    at the instant of ``state``. The larger one bounds both: the two errors have one cause, and may add or cancel.
    """
    at_capture = 0.0 if fix is None else hypot(*fix.bias_jacobian[Bias.TIME_OFFSET][:2])
    if state is None:
        return at_capture
    turning = cross(rotate(state.ned_from_body, state.rates), relative_ned)
    return max(at_capture, hypot(*add(turning, state.velocity_ned or ZERO3)[:2]))
