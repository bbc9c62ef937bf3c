"""Poses of a video's frames by its telemetry, interpolated at a time of the video. PURE."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from math import cos, degrees, hypot, radians
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
from fwav_companion.geometry.vectors import norm, scale
from fwav_companion.photographs.makers import BAROMETER, CONSUMER, GNSS_HEIGHT, UNRELIABLE
from fwav_companion.photographs.picture_pose import AltDatum, Altitude, NoPose, PicturePose, PoseSigmas, Sigma
from fwav_companion.photographs.srt import SubtitleRow

TIME_SIGMA_S: Final = 0.5
"""One sigma of the telemetry's time against the picture's, where it comes once a second."""
FRAME_TIME_SIGMA_S: Final = 0.1
"""The same where it comes with every frame: DJI's latency is not published."""
SLOW_S: Final = 0.5
"""Interval of rows from which the telemetry counts as once a second."""
LONGEST_GAP_S: Final = 3.0
METRES_PER_DEGREE: Final = 111_320.0


def pose_at(
    rows: Sequence[SubtitleRow], at_s: float, angles_deg: tuple[float, float, float] | None
) -> PicturePose | NoPose:
    """The pose at a time of the video. ``angles_deg``: for layouts without gimbal angles."""
    index = bisect_right(rows, at_s, key=lambda row: row.at_s)
    before, after = rows[max(0, index - 1)], rows[min(index, len(rows) - 1)]
    if min(abs(before.at_s - at_s), abs(after.at_s - at_s)) > LONGEST_GAP_S:
        return NoPose(f"no telemetry within {LONGEST_GAP_S:g} s of {at_s:g} s")
    span = after.at_s - before.at_s
    part = 0.0 if span <= 0.0 else min(1.0, max(0.0, (at_s - before.at_s) / span))
    turn_rate = 0.0
    given = angles_deg
    if given is None:
        if before.angles_deg is None or after.angles_deg is None:
            return NoPose("its telemetry has no camera angles; give --angles ROLL,PITCH,YAW")
        turn = log(multiply(conjugate(_attitude(before)), _attitude(after)))
        roll, pitch, yaw = euler_from_quaternion(multiply(_attitude(before), exp(scale(turn, part))))
        given = (degrees(roll), degrees(pitch), degrees(yaw))
        turn_rate = norm(turn) / span if span > 0.0 else 0.0
    speed = _distance_m(before, after) / span if span > 0.0 else 0.0
    time_sigma_s = TIME_SIGMA_S if span > SLOW_S else FRAME_TIME_SIGMA_S
    own = CONSUMER.attitude_deg
    sigmas = PoseSigmas(
        position_m=Sigma(hypot(CONSUMER.position_m.own, speed * time_sigma_s), CONSUMER.position_m.shared),
        attitude_deg=Sigma(hypot(own.own, degrees(turn_rate) * time_sigma_s), own.shared),
        heading_deg=CONSUMER.heading_deg,
    )
    above = _between(before.above_takeoff_m, after.above_takeoff_m, part)
    absolute = _between(before.absolute_m, after.absolute_m, part)
    return PicturePose(
        lat_deg=_known(before.lat_deg) + part * (_known(after.lat_deg) - _known(before.lat_deg)),
        lon_deg=_known(before.lon_deg) + part * (_known(after.lon_deg) - _known(before.lon_deg)),
        roll_deg=given[0],
        pitch_deg=given[1],
        yaw_deg=given[2],
        absolute=None if absolute is None else _absolute(absolute, before.absolute_datum),
        above_takeoff=None if above is None else Altitude(above, AltDatum.TAKEOFF, BAROMETER),
        sigmas=sigmas,
        layout="video telemetry",
        notes=(f"telemetry's time within {time_sigma_s:g} s",),
    )


def _absolute(metres: float, datum: AltDatum | None) -> Altitude:
    """A stated datum is that of a sensor with GNSS; else it is a consumer drone's."""
    if datum is None:
        return Altitude(metres, AltDatum.EGM96, UNRELIABLE, "the datum of the video's altitude is not stated")
    return Altitude(metres, datum, GNSS_HEIGHT)


def _attitude(row: SubtitleRow) -> Quaternion:
    roll, pitch, yaw = row.angles_deg or (0.0, 0.0, 0.0)
    return quaternion_from_euler(radians(roll), radians(pitch), radians(yaw))


def _between(before: float | None, after: float | None, part: float) -> float | None:
    return None if before is None or after is None else before + part * (after - before)


def _known(value: float | None) -> float:
    return 0.0 if value is None else value


def _distance_m(before: SubtitleRow, after: SubtitleRow) -> float:
    lat = _known(before.lat_deg)
    north = (_known(after.lat_deg) - lat) * METRES_PER_DEGREE
    east = (_known(after.lon_deg) - _known(before.lon_deg)) * METRES_PER_DEGREE * cos(radians(lat))
    return hypot(north, east)
