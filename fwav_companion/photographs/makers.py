"""The makers' layouts of a pose in a picture's tags: one row a layout, tried in order.

Gimbal tags count roll, pitch and yaw in the order ZYX from north, east and down. Where a layout counts pitch from the
nadir, its angles are those of a body whose camera looks down at zero (Pix4D's convention), or of a gimbal (Autel).
Sigmas: `fwav-companion locate` may be given others by the configuration; these are what the makers and public field
tests state (OpenAthena's target errors: 1.2 to 3.3 degrees of pointing; DJI: about 5 m of barometric height).
"""

from __future__ import annotations

from enum import StrEnum
from typing import Final

import msgspec

from fwav_companion.photographs.picture_pose import AltDatum, PoseSigmas, Sigma

CONSUMER: Final = PoseSigmas(position_m=Sigma(1.0, 2.0), attitude_deg=Sigma(0.3, 0.5), heading_deg=3.0)
"""Consumer GNSS: 1 m of each picture, 2 m of all; a compass that was calibrated."""
STEADY: Final = PoseSigmas(position_m=Sigma(1.0, 2.0), attitude_deg=Sigma(0.3, 0.5), heading_deg=1.5)
"""Parrot and Skydio: consumer GNSS, heading by vision."""
ADJUSTED: Final = PoseSigmas(position_m=Sigma(0.1, 2.0), attitude_deg=Sigma(0.05, 0.2), heading_deg=0.5)
"""Bundle adjustment without ground control: pictures agree with one another, the whole is where their GNSS was."""
ROUGH: Final = PoseSigmas(position_m=Sigma(1.0, 3.0), attitude_deg=Sigma(0.5, 1.0), heading_deg=3.0)
SURVEY_HEADING_DEG: Final = 1.0
"""Heading of a vehicle with RTK in motion, degrees."""
BAROMETER: Final = Sigma(1.0, 3.0)
"""Height above the take-off by the barometer, metres."""
UNRELIABLE: Final = Sigma(1.0, 30.0)
"""Absolute altitude of a consumer drone, metres: it follows the barometer, and was found wrong by up to 137 m."""
GNSS_HEIGHT: Final = Sigma(1.0, 5.0)
"""Absolute altitude by consumer GNSS, metres."""
DISPUTED: Final = Sigma(1.0, 20.0)
"""Absolute altitude whose datum the maker does not state: ellipsoid and geoid lie up to 106 m apart, in most inhabited
places below 50 m, and half of it is the error's deviation."""


class PitchZero(StrEnum):
    """Where a layout's pitch is 0."""

    HORIZON = "horizon"
    NADIR_GIMBAL = "nadir of a gimbal"
    """Pitch plus 90 degrees: roll is about the optical axis."""
    NADIR_BODY = "nadir of a body"
    """Angles of a body with a camera that looks down: roll is about the body's forward axis."""


class MakerLayout(msgspec.Struct, frozen=True, kw_only=True):
    """Names and meaning of one maker's tags."""

    name: str
    makes: tuple[str, ...] = ()
    """Beginnings of EXIF Make, lower case; empty: any."""
    models: tuple[str, ...] = ()
    """Parts of EXIF Model, lower case; empty: any."""
    angles: tuple[str, str, str]
    """XMP names of roll, pitch and yaw."""
    added_angles: tuple[str, str, str] | None = None
    """XMP names of the platform's roll, pitch and yaw, to which the angles are relative."""
    pitch_zero: PitchZero = PitchZero.HORIZON
    roll_sign: float = 1.0
    lat: tuple[str, ...] = ()
    """XMP names of the latitude; empty: EXIF's position."""
    lon: tuple[str, ...] = ()
    absolute: tuple[str, ...] = ()
    """XMP names of the absolute altitude; EXIF's counts where they are missing."""
    relative: tuple[str, ...] = ()
    datum: AltDatum = AltDatum.EGM96
    """Datum of the absolute altitude where the picture's own tags do not state it."""
    height_m: Sigma = GNSS_HEIGHT
    datum_note: str = ""
    sigmas: PoseSigmas = CONSUMER


PIX4D: Final = ("Camera:Roll", "Camera:Pitch", "Camera:Yaw")
GIMBAL: Final = ("GimbalRollDegree", "GimbalPitchDegree", "GimbalYawDegree")
DJI_LAT: Final = ("GpsLatitude", "drone-dji:Latitude", "Latitude")
DJI_LON: Final = ("GpsLongitude", "GpsLongtitude", "drone-dji:Longitude", "Longitude", "Longtitude")
"""GpsLongtitude is how older firmware spells it."""
LAYOUTS: Final = (
    MakerLayout(
        name="Skydio",
        angles=("CameraOrientationNED/Roll", "CameraOrientationNED/Pitch", "CameraOrientationNED/Yaw"),
        lat=("Latitude",),
        lon=("Longitude",),
        absolute=("AbsoluteAltitude",),
        relative=("RelativeAltitude",),
        sigmas=STEADY,
    ),
    MakerLayout(
        name="Autel",
        makes=("autel",),
        angles=GIMBAL,
        lat=DJI_LAT,
        lon=DJI_LON,
        absolute=("AbsoluteAltitude",),
        relative=("RelativeAltitude",),
        datum=AltDatum.ELLIPSOID,
        height_m=DISPUTED,
        datum_note="Autel does not state its altitude's datum; taken as above the ellipsoid",
        sigmas=ROUGH,
    ),
    MakerLayout(
        name="DJI",
        angles=GIMBAL,
        lat=DJI_LAT,
        lon=DJI_LON,
        absolute=("AbsoluteAltitude",),
        relative=("RelativeAltitude",),
        height_m=UNRELIABLE,
        datum_note="a DJI without RTK has a barometric absolute altitude, found wrong by up to 137 m",
    ),
    MakerLayout(
        name="Parrot ANAFI Ai",
        models=("anafiai", "anafi ai"),
        angles=("CameraRollDegree", "CameraPitchDegree", "CameraYawDegree"),
        datum=AltDatum.ELLIPSOID,
        sigmas=STEADY,
    ),
    MakerLayout(name="Parrot", angles=("CameraRollDegree", "CameraPitchDegree", "CameraYawDegree"), sigmas=STEADY),
    MakerLayout(
        name="Teal",
        angles=("CameraRoll", "CameraPitch", "CameraYaw"),
        added_angles=("PlatformRoll", "PlatformPitch", "PlatformYaw"),
        sigmas=CONSUMER,
    ),
    MakerLayout(
        name="Autel (Pix4D tags)",
        makes=("autel",),
        angles=PIX4D,
        pitch_zero=PitchZero.NADIR_GIMBAL,
        relative=("Camera:AboveGroundAltitude", "AboveGroundAltitude"),
        height_m=DISPUTED,
        datum_note="the datum of Autel's altitude is disputed; taken as above sea level",
        sigmas=ROUGH,
    ),
    MakerLayout(
        name="senseFly",
        makes=("sensefly",),
        angles=PIX4D,
        pitch_zero=PitchZero.NADIR_BODY,
        roll_sign=-1.0,  # as OpenDroneMap reads this maker's tags
        height_m=DISPUTED,
        datum_note="no vertical datum in the tags; taken as above sea level",
    ),
    MakerLayout(
        name="Wingtra",
        makes=("wingtra", "sony"),
        angles=PIX4D,
        pitch_zero=PitchZero.NADIR_BODY,
        datum=AltDatum.ELLIPSOID,
        height_m=DISPUTED,
        datum_note="Wingtra's PPK heights are above the ellipsoid; taken as such",
    ),
    MakerLayout(
        name="Pix4D tags",
        angles=PIX4D,
        pitch_zero=PitchZero.NADIR_BODY,
        height_m=DISPUTED,
        datum_note="no vertical datum in the tags; taken as above sea level",
    ),
)
