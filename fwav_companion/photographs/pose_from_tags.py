"""The pose of a picture by its tags and the table of the makers."""

from __future__ import annotations

from math import radians

import msgspec

from fwav_companion.geometry.rotations import euler_from_matrix, matrix_from_quaternion, quaternion_from_euler
from fwav_companion.geometry.vectors import Matrix3, multiply
from fwav_companion.photographs.exif_tags import MAKE, MODEL, exif_altitude, exif_direction, exif_place, text_of
from fwav_companion.photographs.makers import (
    BAROMETER,
    CONSUMER,
    DISPUTED,
    GNSS_HEIGHT,
    LAYOUTS,
    SURVEY_HEADING_DEG,
    MakerLayout,
    PitchZero,
)
from fwav_companion.photographs.picture_pose import (
    AltDatum,
    Altitude,
    NoPose,
    PicturePose,
    PoseSigmas,
    Sigma,
)
from fwav_companion.photographs.tags import PictureTags, finite_number

RTK_FIXED, RTK_FLOAT, SINGLE = 50, 32, 16
"""DJI's RtkFlag: fixed; the least of float (32 to 49); a single solution, above the ellipsoid, too."""
CORRECTION_SHARED_M = 0.03
"""One sigma of a base station's or service's position, shared by all pictures, metres."""
SINGLE_SHARED_M = 2.0
LARGEST_SIGMA_M = 100.0
LARGEST_ALTITUDE_M = 20_000.0
HALF_TURN_DEG = 180.0
BODY_FROM_NADIR_GIMBAL: Matrix3 = ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
"""Gimbal axes (x optical, y right, z image down) of a camera that looks down, image top forward: Ry(-90 degrees)."""
GEOID_CRS, ELLIPSOID_CRS = ("5773", "egm96"), ("4979", "ellipsoid")
"""What senseFly's VertCS holds for either datum."""


def pose_from_tags(tags: PictureTags) -> PicturePose | NoPose:
    """The pose by the first layout whose angles are all there; NoPose with its reason otherwise."""
    layout = _layout(tags)
    place = _place(tags, layout)
    if place is None:
        return NoPose("no position in its XMP or EXIF (messengers remove it: use the original file)")
    if place == (0.0, 0.0):
        return NoPose("its position is 0, 0: the receiver had no fix")
    if tags.text("GpsStatus").lower() == "invalid":
        return NoPose("its position is none by its own tags (GpsStatus Invalid)")
    if not (abs(place[0]) <= 90.0 and abs(place[1]) <= 180.0):
        return NoPose(f"its position {place[0]:g}, {place[1]:g} is not a place on the earth")
    if layout is None:
        bare = _pose(tags, LAYOUTS[-1], place, (0.0, 0.0, exif_direction(tags) or 0.0), ())
        bare = msgspec.structs.replace(bare, layout="EXIF", sigmas=CONSUMER)
        has_heading = exif_direction(tags) is not None
        return NoPose("no camera angles in its XMP; give --angles ROLL,PITCH,YAW", bare, has_heading=has_heading)
    angles = _angles(tags, layout)
    if isinstance(angles, str):
        return NoPose(angles, _pose(tags, layout, place, (0.0, 0.0, 0.0), ()))
    roll, pitch, yaw, notes = angles
    return _pose(tags, layout, place, (roll, pitch, yaw), notes)


def _layout(tags: PictureTags) -> MakerLayout | None:
    make, model = text_of(tags, MAKE).lower(), text_of(tags, MODEL).lower()
    for layout in LAYOUTS:
        names = (*layout.angles, *(layout.added_angles or ()))
        if (
            (not layout.makes or make.startswith(layout.makes))
            and (not layout.models or any(part in model for part in layout.models))
            and all(tags.number(name) is not None for name in names)
        ):
            return layout
    return None


def _place(tags: PictureTags, layout: MakerLayout | None) -> tuple[float, float] | None:
    if layout is not None and layout.lat:
        lat, lon = tags.number(*layout.lat), tags.number(*layout.lon)
        if lat is not None and lon is not None:
            return (lat, lon)
    return exif_place(tags)


def _angles(tags: PictureTags, layout: MakerLayout) -> tuple[float, float, float, tuple[str, ...]] | str:
    """Roll, pitch and yaw of the gimbal, degrees, with notes; or the reason why they are no attitude."""
    roll, pitch, yaw = (tags.number(name) or 0.0 for name in layout.angles)
    if layout.pitch_zero is PitchZero.HORIZON and layout.added_angles is None and pitch == 0.0 and yaw == 0.0:
        return "its pitch and yaw are both exactly 0: the angles were not written; give --angles ROLL,PITCH,YAW"
    if max(abs(roll), abs(pitch), abs(yaw)) > 2.0 * HALF_TURN_DEG:
        return f"its angles {roll:g}, {pitch:g}, {yaw:g} are no degrees"
    roll *= layout.roll_sign
    if layout.added_angles is not None:
        more = [tags.number(name) or 0.0 for name in layout.added_angles]
        roll, pitch, yaw = roll + more[0], pitch + more[1], yaw + more[2]
    if layout.pitch_zero is PitchZero.NADIR_GIMBAL:
        pitch -= 90.0
    elif layout.pitch_zero is PitchZero.NADIR_BODY:
        return (*gimbal_angles_from_nadir_body(roll, pitch, yaw), ())
    if abs(_signed(roll)) > 90.0:
        return (
            roll - HALF_TURN_DEG,
            pitch,
            _signed(yaw - HALF_TURN_DEG),
            ("roll was flipped near the nadir; turned back",),
        )
    return roll, pitch, yaw, ()


def gimbal_angles_from_nadir_body(roll: float, pitch: float, yaw: float) -> tuple[float, float, float]:
    """Gimbal angles, degrees, of a camera that looks down in a body with these angles."""
    ned_from_body = matrix_from_quaternion(quaternion_from_euler(radians(roll), radians(pitch), radians(yaw)))
    angles = euler_from_matrix(multiply(ned_from_body, BODY_FROM_NADIR_GIMBAL))
    return (angles[0] / radians(1.0), angles[1] / radians(1.0), angles[2] / radians(1.0))


def _signed(angle_deg: float) -> float:
    return (angle_deg + HALF_TURN_DEG) % 360.0 - HALF_TURN_DEG


def _pose(
    tags: PictureTags,
    layout: MakerLayout,
    place: tuple[float, float],
    angles: tuple[float, float, float],
    notes: tuple[str, ...],
) -> PicturePose:
    relative = tags.number(*layout.relative) if layout.relative else None
    absolute, sigmas = _absolute(tags, layout)
    return PicturePose(
        lat_deg=place[0],
        lon_deg=place[1],
        roll_deg=angles[0],
        pitch_deg=angles[1],
        yaw_deg=angles[2],
        absolute=absolute,
        above_takeoff=(
            Altitude(relative, AltDatum.TAKEOFF, BAROMETER)
            if relative is not None and abs(relative) < LARGEST_ALTITUDE_M
            else None
        ),
        sigmas=sigmas,
        layout=layout.name,
        notes=notes,
    )


def _absolute(tags: PictureTags, layout: MakerLayout) -> tuple[Altitude | None, PoseSigmas]:
    """The absolute altitude with the datum that the picture's own tags state, else the layout's; the pose's sigmas."""
    metres = tags.number(*layout.absolute) if layout.absolute else None
    metres = exif_altitude(tags) if metres is None else metres
    flag = _rtk_flag(tags) if layout.name == "DJI" else 0
    if metres is None or abs(metres) > LARGEST_ALTITUDE_M:
        return None, layout.sigmas
    if flag >= SINGLE:
        return _by_rtk(tags, metres, flag)
    stated = tags.text("VertCS", "Camera:VertCS").lower()
    if any(word in stated for word in GEOID_CRS):
        return Altitude(metres, AltDatum.EGM96, _accuracy(tags)), layout.sigmas
    if any(word in stated for word in ELLIPSOID_CRS):
        return Altitude(metres, AltDatum.ELLIPSOID, _accuracy(tags)), layout.sigmas
    if layout.name == "Skydio" and "x10" in text_of(tags, MODEL).lower() and not tags.text(*layout.absolute):
        note = "a Skydio X10 with RTK writes ellipsoid heights as above sea level; taken as above the ellipsoid"
        return Altitude(metres, AltDatum.ELLIPSOID, DISPUTED, note), layout.sigmas
    return Altitude(metres, layout.datum, layout.height_m, layout.datum_note), layout.sigmas


def _rtk_flag(tags: PictureTags) -> int:
    flag = finite_number(tags.text("RtkFlag"))
    return int(flag) if flag is not None and abs(flag) < 1000.0 else 0


def _by_rtk(tags: PictureTags, metres: float, flag: int) -> tuple[Altitude, PoseSigmas]:
    """Altitude above the ellipsoid and sigmas of a receiver with corrections (DJI), by its own deviations."""
    fixed = flag >= RTK_FIXED
    least = CORRECTION_SHARED_M if fixed else 1.0
    deviations = [tags.number(name) for name in ("RtkStdLat", "RtkStdLon", "RtkStdHgt")]
    lat, lon, height = (least if d is None or not 0.0 < d < LARGEST_SIGMA_M else d for d in deviations)
    shared = CORRECTION_SHARED_M if fixed else SINGLE_SHARED_M
    shared_height = CORRECTION_SHARED_M if fixed else SINGLE_SHARED_M * 1.5
    sigmas = PoseSigmas(
        position_m=Sigma(max(lat, lon), shared),
        attitude_deg=CONSUMER.attitude_deg,
        heading_deg=SURVEY_HEADING_DEG if fixed else 1.5,
    )
    note = "" if fixed else f"RtkFlag {flag}: not a fixed RTK solution"
    return Altitude(metres, AltDatum.ELLIPSOID, Sigma(height, shared_height), note), sigmas


def _accuracy(tags: PictureTags) -> Sigma:
    stated = tags.number("GPSZAccuracy", "Camera:GPSZAccuracy")
    good = stated is not None and 0.0 < stated < LARGEST_SIGMA_M
    return Sigma(stated, stated) if good and stated is not None else GNSS_HEIGHT
