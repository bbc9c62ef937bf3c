"""Poses of a video's frames by its telemetry, interpolated at a time of the video. PURE."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from math import cos, degrees, hypot, radians, remainder
from typing import Final

from fwav_companion.geometry.rotations import (
    Quaternion,
    conjugate,
    euler_from_quaternion,
    exp,
    log,
    multiply,
    quaternion_from_euler,
)
from fwav_companion.geometry.vectors import ZERO3, Vector3, norm, scale
from fwav_companion.photographs.makers import BAROMETER, CONSUMER, GNSS_HEIGHT, UNRELIABLE
from fwav_companion.photographs.picture_pose import (
    AltDatum,
    Altitude,
    NoPose,
    PicturePose,
    PoseMotion,
    PoseSigmas,
    Sigma,
)
from fwav_companion.photographs.telemetry_rows import TelemetryRow

DELAY_SIGMA_S: Final = 0.5
"""One sigma of the telemetry's delay against the pictures, shared by a video, where it comes once a second."""
FRAME_DELAY_SIGMA_S: Final = 0.1
"""The same where it comes with every frame: DJI's latency is not published."""
JITTER_PER_INTERVAL: Final = 0.1
"""One sigma of a row's own time, in intervals of rows: DiffTime jitters by 1 ms in 17; samples are not resampled."""
SLOW_S: Final = 0.5
"""Interval of rows from which the telemetry counts as once a second."""
LONGEST_GAP_S: Final = 3.0
METRES_PER_DEGREE: Final = 111_320.0


def pose_at(
    rows: Sequence[TelemetryRow], at_s: float, angles_deg: tuple[float, float, float] | None
) -> PicturePose | NoPose:
    """The pose at a time of the video. ``angles_deg``: for layouts without gimbal angles."""
    index = bisect_right(rows, at_s, key=lambda row: row.at_s)
    before, after = rows[max(0, index - 1)], rows[min(index, len(rows) - 1)]
    if min(abs(before.at_s - at_s), abs(after.at_s - at_s)) > LONGEST_GAP_S:
        return NoPose(f"no telemetry within {LONGEST_GAP_S:g} s of {at_s:g} s")
    span = after.at_s - before.at_s
    part = 0.0 if span <= 0.0 else min(1.0, max(0.0, (at_s - before.at_s) / span))
    turn = ZERO3
    given = angles_deg
    if given is None:
        if before.angles_deg is None or after.angles_deg is None:
            return NoPose("its telemetry has no camera angles; give --angles ROLL,PITCH,YAW")
        turn = log(multiply(conjugate(_attitude(before)), _attitude(after)))
        roll, pitch, yaw = euler_from_quaternion(multiply(_attitude(before), exp(scale(turn, part))))
        given = (degrees(roll), degrees(pitch), degrees(yaw))
    above = _between(before.above_takeoff_m, after.above_takeoff_m, part)
    absolute = _between(before.absolute_m, after.absolute_m, part)
    per_s = 1.0 / span if span > 0.0 else 0.0
    motion = PoseMotion(
        velocity_ned=scale(_way_ned(before, after), per_s),
        turn=scale(turn, per_s),
        delay_sigma_s=DELAY_SIGMA_S if _interval_s(rows) > SLOW_S else FRAME_DELAY_SIGMA_S,
    )
    jitter_s, own = JITTER_PER_INTERVAL * span, CONSUMER.attitude_deg
    sigmas = PoseSigmas(
        position_m=Sigma(
            hypot(CONSUMER.position_m.own, norm(motion.velocity_ned) * jitter_s), CONSUMER.position_m.shared
        ),
        attitude_deg=Sigma(hypot(own.own, degrees(norm(motion.turn)) * jitter_s), own.shared),
        heading_deg=CONSUMER.heading_deg,
    )
    return PicturePose(
        lat_deg=_known(before.lat_deg) + part * (_known(after.lat_deg) - _known(before.lat_deg)),
        lon_deg=remainder(_known(before.lon_deg) + part * _eastward_deg(before, after), 360.0),
        roll_deg=given[0],
        pitch_deg=given[1],
        yaw_deg=given[2],
        absolute=None if absolute is None else _absolute(absolute, before.absolute_datum),
        above_takeoff=None if above is None else Altitude(above, AltDatum.TAKEOFF, BAROMETER),
        sigmas=sigmas,
        layout="video telemetry",
        motion=motion,
        notes=(f"telemetry's delay within {motion.delay_sigma_s:g} s",),
    )


def _absolute(metres: float, datum: AltDatum | None) -> Altitude:
    """A stated datum is that of a sensor with GNSS; else it is a consumer drone's."""
    if datum is None:
        return Altitude(metres, AltDatum.EGM96, UNRELIABLE, "the datum of the video's altitude is not stated")
    return Altitude(metres, datum, GNSS_HEIGHT)


def _attitude(row: TelemetryRow) -> Quaternion:
    roll, pitch, yaw = row.angles_deg or (0.0, 0.0, 0.0)
    return quaternion_from_euler(radians(roll), radians(pitch), radians(yaw))


def _between(before: float | None, after: float | None, part: float) -> float | None:
    return None if before is None or after is None else before + part * (after - before)


def _known(value: float | None) -> float:
    return 0.0 if value is None else value


def _interval_s(rows: Sequence[TelemetryRow]) -> float:
    """The mean interval of the rows, seconds."""
    return (rows[-1].at_s - rows[0].at_s) / (len(rows) - 1) if len(rows) > 1 else 1.0


def _eastward_deg(before: TelemetryRow, after: TelemetryRow) -> float:
    """The longitude's change, also across the antimeridian."""
    return remainder(_known(after.lon_deg) - _known(before.lon_deg), 360.0)


def _way_ned(before: TelemetryRow, after: TelemetryRow) -> Vector3:
    """From one row's place to the next one's, metres."""
    lat = _known(before.lat_deg)
    north = (_known(after.lat_deg) - lat) * METRES_PER_DEGREE
    east = _eastward_deg(before, after) * METRES_PER_DEGREE * cos(radians(lat))
    above = before.above_takeoff_m, after.above_takeoff_m
    lower, upper = above if None not in above else (before.absolute_m, after.absolute_m)
    return (north, east, 0.0 if lower is None or upper is None else lower - upper)
