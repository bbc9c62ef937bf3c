"""The tags that makers of drones write into a picture, for a camera whose true pose is known.

Written from the makers' published descriptions and public samples, and from nothing of the companion: a second opinion
about names, signs, where pitch counts from, and what an altitude counts from.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from io import BytesIO

XMP_HEADER = b"http://ns.adobe.com/xap/1.0/\x00"
MAKE, MODEL, ORIENTATION, EXIF_IFD, GPS_IFD = 0x010F, 0x0110, 0x0112, 0x8769, 0x8825
FOCAL_35MM, WIDTH, HEIGHT = 0xA405, 0xA002, 0xA003
PLACE = -1
"""Stands for the GPS directory: latitude, longitude, altitude."""


@dataclass(frozen=True)
class TruePicture:
    """A camera's true pose and lens. Angles in degrees: gimbal yaw, pitch (-90 down) and roll."""

    lat: float
    lon: float
    alt_amsl: float
    undulation: float
    """Geoid above ellipsoid at the place, metres."""
    above_takeoff: float
    roll: float
    pitch: float
    yaw: float
    width: int
    height: int
    focal_px: float

    @property
    def ellipsoid(self) -> float:
        """Height above the ellipsoid."""
        return self.alt_amsl + self.undulation


def _packet(namespace: str, prefix: str, values: dict[str, str], *, elements: bool = False, about: str = "") -> bytes:
    """An XMP packet with the values as attributes or as elements."""
    attributes = "" if elements else "".join(f'\n   {prefix}:{k}="{v}"' for k, v in values.items())
    inside = "".join(f"\n   <{prefix}:{k}>{v}</{prefix}:{k}>" for k, v in values.items()) if elements else ""
    return (
        '<?xpacket begin="" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/">'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        f'<rdf:Description rdf:about="{about}" xmlns:{prefix}="{namespace}"{attributes}>{inside}</rdf:Description>'
        '</rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
    ).encode()


def _signed(value: float, digits: int = 2) -> str:
    return f"{value:+.{digits}f}"


def _dji_values(p: TruePicture, absolute: float) -> dict[str, str]:
    return {
        "GpsLatitude": f"{p.lat:.9f}",
        "GpsLongitude": f"{p.lon:.9f}",
        "AbsoluteAltitude": _signed(absolute, 3),
        "RelativeAltitude": _signed(p.above_takeoff, 3),
        "GimbalRollDegree": _signed(p.roll, 3),
        "GimbalYawDegree": _signed((p.yaw + 180.0) % 360.0 - 180.0, 3),
        "GimbalPitchDegree": _signed(p.pitch, 3),
        "FlightYawDegree": _signed(12.0),  # the airframe's, which is not the camera's
        "FlightPitchDegree": _signed(3.0),
        "FlightRollDegree": _signed(-2.0),
    }


DJI = "http://www.dji.com/drone-dji/1.0/"


def dji_consumer(p: TruePicture) -> tuple[bytes, dict[int, object]]:
    """DJI without RTK: the absolute altitude follows the barometer, here 41 m off; lens as 35 mm equivalent."""
    equivalent = p.focal_px * 36.0 / p.width
    return _packet(DJI, "drone-dji", _dji_values(p, p.alt_amsl - 41.0)), {
        MAKE: "DJI", MODEL: "FC3170", FOCAL_35MM: round(equivalent),
    }  # fmt: skip


def dji_consumer_old(p: TruePicture) -> tuple[bytes, dict[int, object]]:
    """Older DJI: misspelt longitude, elements, roll flipped by half a turn, calibrated focal length."""
    values = _dji_values(p, p.alt_amsl + 20.0)
    values["GpsLongtitude"] = values.pop("GpsLongitude")
    values["GimbalRollDegree"] = _signed((p.roll + 180.0 + 180.0) % 360.0 - 180.0, 3)
    values["GimbalYawDegree"] = _signed((p.yaw + 180.0 + 180.0) % 360.0 - 180.0, 3)
    values |= {
        "CalibratedFocalLength": f"{p.focal_px:.6f}",
        "CalibratedOpticalCenterX": f"{(p.width - 1) / 2:.6f}",
        "CalibratedOpticalCenterY": f"{(p.height - 1) / 2:.6f}",
    }
    return _packet(DJI, "drone-dji", values, elements=True), {MAKE: "Hasselblad", MODEL: "L1D-20c"}


def dji_rtk(p: TruePicture) -> tuple[bytes, dict[int, object]]:
    """DJI with a fixed RTK solution: heights above the ellipsoid, DewarpData with offsets from the centre."""
    f = p.focal_px
    values = _dji_values(p, p.ellipsoid) | {
        "GpsStatus": "RTK",
        "AltitudeType": "RtkAlt",
        "RtkFlag": "50",
        "RtkStdLon": "0.01214",
        "RtkStdLat": "0.01314",
        "RtkStdHgt": "0.02514",
        "DewarpData": f"2026-05-01;{f:.4f},{f:.4f},0.0,0.0,0.0,0.0,0.0,0.0,0.0",
        "DewarpFlag": "0",
    }
    return _packet(DJI, "drone-dji", values), {MAKE: "DJI", MODEL: "M3E"}


def autel_new(p: TruePicture) -> tuple[bytes, dict[int, object]]:
    """Autel with DJI's layout, height above the ellipsoid."""
    values = _dji_values(p, p.ellipsoid) | {"CalibratedFocalLength": f"{p.focal_px:.6f}"}
    return _packet("http://www.autelrobotics.com/drone-autel/1.0/", "drone-autel", values), {
        MAKE: "Autel Robotics", MODEL: "XL709",
    }  # fmt: skip


def autel_old(p: TruePicture) -> tuple[bytes, dict[int, object]]:
    """Older Autel: Pix4D's names, pitch from the nadir, position in EXIF."""
    values = {"Yaw": f"{p.yaw:.3f}", "Pitch": f"{p.pitch + 90.0:.3f}", "Roll": f"{p.roll:.3f}"}
    values["AboveGroundAltitude"] = f"{p.above_takeoff:.3f}"
    return _packet(PIX4D, "Camera", values, elements=True, about="Autel Robotics Meta Data"), {
        MAKE: "Autel Robotics", MODEL: "XT701", FOCAL_35MM: round(p.focal_px * 36.0 / p.width),
        PLACE: (p.lat, p.lon, p.alt_amsl),
    }  # fmt: skip


PIX4D = "http://pix4d.com/camera/1.0"


def parrot(p: TruePicture) -> tuple[bytes, dict[int, object]]:
    """Parrot ANAFI: camera angles from the horizon, position in EXIF above the geoid."""
    values = {
        "CameraYawDegree": f"{p.yaw:.4f}", "CameraPitchDegree": f"{p.pitch:.4f}", "CameraRollDegree": f"{p.roll:.4f}",
        "DroneYawDegree": "10.0", "DronePitchDegree": "-4.0", "DroneRollDegree": "1.0",
    }  # fmt: skip
    return _packet("http://www.parrot.com/drone-parrot/1.0/", "drone-parrot", values), {
        MAKE: "Parrot", MODEL: "Anafi", FOCAL_35MM: round(p.focal_px * 36.0 / p.width),
        PLACE: (p.lat, p.lon, p.alt_amsl),
    }  # fmt: skip


def skydio(p: TruePicture) -> tuple[bytes, dict[int, object]]:
    """Skydio 2: a struct in NED beside one in FLU, height above the geoid."""
    text = (
        '<?xpacket begin=""?><x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF '
        'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description rdf:about="" '
        'xmlns:drone-skydio="https://www.skydio.com/drone-skydio/1.0/" '
        f'drone-skydio:Latitude="{p.lat:.9f}" drone-skydio:Longitude="{p.lon:.9f}" '
        f'drone-skydio:AbsoluteAltitude="{p.alt_amsl:.4f}" drone-skydio:CalibratedFocalLengthX="{p.focal_px:.4f}" '
        f'drone-skydio:CalibratedFocalLengthY="{p.focal_px:.4f}" '
        f'drone-skydio:CalibratedOpticalCenterX="{(p.width - 1) / 2}" '
        f'drone-skydio:CalibratedOpticalCenterY="{(p.height - 1) / 2}">'
        '<drone-skydio:CameraOrientationFLU rdf:parseType="Resource">'
        f"<drone-skydio:Yaw>{-p.yaw:.4f}</drone-skydio:Yaw><drone-skydio:Pitch>{-p.pitch:.4f}</drone-skydio:Pitch>"
        f"<drone-skydio:Roll>{p.roll:.4f}</drone-skydio:Roll></drone-skydio:CameraOrientationFLU>"
        '<drone-skydio:CameraOrientationNED rdf:parseType="Resource">'
        f"<drone-skydio:Yaw>{p.yaw:.4f}</drone-skydio:Yaw><drone-skydio:Pitch>{p.pitch:.4f}</drone-skydio:Pitch>"
        f"<drone-skydio:Roll>{p.roll:.4f}</drone-skydio:Roll></drone-skydio:CameraOrientationNED>"
        '</rdf:Description></rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
    )
    return text.encode(), {MAKE: "Skydio", MODEL: "2"}


def teal(p: TruePicture) -> tuple[bytes, dict[int, object]]:
    """Teal 2: rationals, the camera relative to the platform."""
    platform = (4.0, -3.0, 77.0)

    def ratio(value: float) -> str:
        return f"{round(value * 10000)}/10000"

    camera = (p.roll - platform[0], p.pitch - platform[1], p.yaw - platform[2])
    values = {f"Platform{n}": ratio(v) for n, v in zip(("Roll", "Pitch", "Yaw"), platform, strict=True)}
    values |= {f"Camera{n}": ratio(v) for n, v in zip(("Roll", "Pitch", "Yaw"), camera, strict=True)}
    return _packet("http://ns.adobe.com/exif/1.0/", "exif", values), {
        MAKE: "Teledyne FLIR", MODEL: "Teal 2", FOCAL_35MM: round(p.focal_px * 36.0 / p.width),
        PLACE: (p.lat, p.lon, p.alt_amsl),
    }  # fmt: skip


def _body_angles(p: TruePicture) -> tuple[float, float, float]:
    """Roll, pitch, yaw, degrees, of a body under which the camera looks straight down, image top forward.

    R(body) = R(gimbal) Ry(+90 deg): the gimbal of a camera that looks down is pitched by -90 degrees in the body.
    """
    r, t, y = (math.radians(angle) for angle in (p.roll, p.pitch, p.yaw))
    cr, sr, ct, st, cy, sy = math.cos(r), math.sin(r), math.cos(t), math.sin(t), math.cos(y), math.sin(y)
    g = (
        (cy * ct, cy * st * sr - sy * cr, cy * st * cr + sy * sr),
        (sy * ct, sy * st * sr + cy * cr, sy * st * cr - cy * sr),
        (-st, ct * sr, ct * cr),
    )
    b = [(-row[2], row[1], row[0]) for row in g]  # columns of g times Ry(90 deg)
    return (
        math.degrees(math.atan2(b[2][1], b[2][2])),
        math.degrees(-math.asin(b[2][0])),
        math.degrees(math.atan2(b[1][0], b[0][0])),
    )


def sensefly(p: TruePicture) -> tuple[bytes, dict[int, object]]:
    """senseFly: a body's angles with roll to the left, the datum in VertCS, accuracies."""
    roll, pitch, yaw = _body_angles(p)
    values = {
        "Yaw": f"{yaw % 360.0:.4f}", "Pitch": f"{pitch:.4f}", "Roll": f"{-roll:.4f}", "VertCS": "EPSG:5773",
        "GPSXYAccuracy": "1.2", "GPSZAccuracy": "2.0",
    }  # fmt: skip
    return _packet(PIX4D, "Camera", values), {
        MAKE: "senseFly", MODEL: "S.O.D.A.", FOCAL_35MM: round(p.focal_px * 36.0 / p.width),
        PLACE: (p.lat, p.lon, p.alt_amsl),
    }  # fmt: skip


def wingtra(p: TruePicture) -> tuple[bytes, dict[int, object]]:
    """WingtraOne: a body's angles, PPK height above the ellipsoid."""
    roll, pitch, yaw = _body_angles(p)
    values = {"Yaw": f"{yaw % 360.0:.4f}", "Pitch": f"{pitch:.4f}", "Roll": f"{roll:.4f}"}
    return _packet(PIX4D, "Camera", values), {
        MAKE: "SONY", MODEL: "DSC-RX1RM2", FOCAL_35MM: round(p.focal_px * 36.0 / p.width),
        PLACE: (p.lat, p.lon, p.ellipsoid),
    }  # fmt: skip


LAYOUTS = {
    each.__name__: each
    for each in (
        dji_consumer, dji_consumer_old, dji_rtk, autel_new, autel_old, parrot, skydio, teal, sensefly, wingtra
    )
}  # fmt: skip


def tagged_jpeg(jpeg: bytes, xmp: bytes, exif: dict[int, object], size: tuple[int, int]) -> bytes:
    """The JPEG with XMP and EXIF, which states ``size`` as that of the picture."""
    from PIL import Image

    tags = Image.Exif()
    for tag in (MAKE, MODEL, ORIENTATION):
        if tag in exif:
            tags[tag] = exif[tag]
    own = tags.get_ifd(EXIF_IFD)
    own[WIDTH], own[HEIGHT] = size
    if FOCAL_35MM in exif:
        own[FOCAL_35MM] = exif[FOCAL_35MM]
    place = exif.get(PLACE)
    if isinstance(place, tuple):
        lat, lon, alt = place
        gps = tags.get_ifd(GPS_IFD)
        gps[1], gps[3], gps[5] = "S" if lat < 0 else "N", "W" if lon < 0 else "E", b"\x01" if alt < 0 else b"\x00"
        gps[2], gps[4], gps[6] = _sexagesimal(abs(lat)), _sexagesimal(abs(lon)), abs(alt)
    image = Image.open(BytesIO(jpeg))
    out = BytesIO()
    image.save(out, "JPEG", exif=tags)
    data = out.getvalue()
    segment = XMP_HEADER + xmp
    return data[:2] + b"\xff\xe1" + struct.pack(">H", len(segment) + 2) + segment + data[2:]


def _sexagesimal(angle: float) -> tuple[float, float, object]:
    from PIL.TiffImagePlugin import IFDRational

    minutes = (angle - math.floor(angle)) * 60.0
    seconds = (minutes - math.floor(minutes)) * 60.0
    return (math.floor(angle), math.floor(minutes), IFDRational(round(seconds * 1_000_000), 1_000_000))
