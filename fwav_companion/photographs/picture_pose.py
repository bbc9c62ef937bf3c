"""The pose and the lens of a picture, each with its errors: a picture's own, and those that all pictures share."""

from __future__ import annotations

from enum import StrEnum

import msgspec


class AltDatum(StrEnum):
    """The level that an altitude counts from."""

    EGM96 = "egm96"
    """The geoid: mean sea level."""
    ELLIPSOID = "ellipsoid"
    """The WGS84 ellipsoid, or that of the correction service."""
    TAKEOFF = "takeoff"
    """The ground at the take-off."""


class Sigma(msgspec.Struct, frozen=True):
    """One sigma of an error in two independent parts."""

    own: float
    """Part that is independent in every picture."""
    shared: float
    """Part that is the same in all pictures of a flight."""


class Altitude(msgspec.Struct, frozen=True):
    """An altitude with its datum and error, metres."""

    metres: float
    datum: AltDatum
    sigma: Sigma
    note: str = ""
    """What is assumed about the datum; empty where the file states it."""


class PoseSigmas(msgspec.Struct, frozen=True, kw_only=True):
    """One sigma of a pose's horizontal position, metres, and angles, degrees."""

    position_m: Sigma
    attitude_deg: Sigma
    """Small rotation about each of three camera axes; shared: the mount."""
    heading_deg: float
    """Rotation about down, shared by all pictures."""


class PoseMotion(msgspec.Struct, frozen=True, kw_only=True):
    """How a pose of a video changes with time, and how late its telemetry may be."""

    velocity_ned: tuple[float, float, float]
    """Metres a second."""
    turn: tuple[float, float, float]
    """Rotation vector about the gimbal's axes (forward, right, down), radians a second."""
    delay_sigma_s: float
    """One sigma of the telemetry's delay against the pictures, shared by the whole video."""


class PicturePose(msgspec.Struct, frozen=True, kw_only=True):
    """Position and attitude of the camera of one picture."""

    lat_deg: float
    lon_deg: float
    roll_deg: float
    """ned_from_gimbal = Rz(yaw) Ry(pitch) Rx(roll), gimbal x along the optical axis, y to the image's right."""
    pitch_deg: float
    """0 at the horizon, -90 straight down."""
    yaw_deg: float
    """Clockwise from true north."""
    absolute: Altitude | None
    """Altitude above the geoid or the ellipsoid; None where the picture has none."""
    above_takeoff: Altitude | None
    """Height above the take-off; None where the picture has none."""
    sigmas: PoseSigmas
    layout: str
    """Whose tags the pose is from."""
    motion: PoseMotion | None = None
    """None for a photograph: its pose is of its own instant."""
    notes: tuple[str, ...] = ()
    """What was assumed or corrected."""


class NoPose(msgspec.Struct, frozen=True):
    """The reason why a picture has no pose."""

    reason: str
    """What is missing, and what to give instead."""
    place: PicturePose | None = None
    """The pose without angles, where only these are missing."""
    has_heading: bool = False
    """Whether the yaw of ``place`` is known: EXIF has the direction of the image."""


def with_angles(found: PicturePose | NoPose, angles_deg: tuple[float, float, float] | None) -> PicturePose | NoPose:
    """The pose with roll, pitch and yaw as the user gives them; None: as found."""
    bare = found.place if isinstance(found, NoPose) else found
    if angles_deg is None or bare is None:
        return found
    roll, pitch, yaw = angles_deg
    return msgspec.structs.replace(bare, roll_deg=roll, pitch_deg=pitch, yaw_deg=yaw)


LEVEL_TILT_DEG = 5.0
"""One sigma of the tilt of a vehicle that is taken as level, degrees: a copter leans by this much in a breeze."""


def with_mount(found: PicturePose | NoPose, mount_deg: tuple[float, float, float] | None) -> PicturePose | NoPose:
    """The pose of a camera in a level vehicle, where EXIF has a direction and the user states the mount.

    ``mount_deg``: roll, pitch and yaw of the mount; its yaw is part of the direction, which is the image's.
    """
    if mount_deg is None or not isinstance(found, NoPose) or found.place is None or not found.has_heading:
        return found
    place = found.place
    own = Sigma(LEVEL_TILT_DEG, place.sigmas.attitude_deg.shared)
    return msgspec.structs.replace(
        place,
        roll_deg=mount_deg[0],
        pitch_deg=mount_deg[1],
        sigmas=msgspec.structs.replace(place.sigmas, attitude_deg=own),
        notes=(*place.notes, f"level vehicle with the mount of --config, within {LEVEL_TILT_DEG:g} degrees"),
    )


class PictureLens(msgspec.Struct, frozen=True, kw_only=True):
    """The lens of a picture, in pixels of the stored image, (0, 0) at the centre of its top left pixel."""

    focal_px: tuple[float, float]
    principal_point: tuple[float, float]
    distortion: tuple[float, ...]
    """k1, k2, p1, p2, k3; empty: a pinhole."""
    size: tuple[int, int]
    focal_sigma: float
    """One sigma of the focal length over the focal length; shared by all pictures of the camera."""
    source: str
    """The tag that the focal length is from."""
    notes: tuple[str, ...] = ()


class NoLens(msgspec.Struct, frozen=True):
    """The reason why a picture has no lens."""

    reason: str
