"""The tables of the inputs: vehicle, links, signing, rates, camera, detections; in the units of the file."""

from __future__ import annotations

from math import radians
from typing import Annotated, Literal, TypeAlias

import msgspec
from msgspec import Meta

from fwav_companion.geometry.mounts import body_from_camera_from_euler
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.links.url import (
    LINK_FORMS,
    LinkUrl,
    SerialUrl,
    UdpUrl,
    UnixUrl,
    parse_detections_url,
    parse_link_url,
)

Positive: TypeAlias = Annotated[float, Meta(gt=0)]
NotNegative: TypeAlias = Annotated[float, Meta(ge=0)]
AngleDeg: TypeAlias = Annotated[float, Meta(ge=-360, le=360)]
MessageName: TypeAlias = Annotated[str, Meta(pattern=r"^[A-Z][A-Z0-9_]*$", description="a message name, as ATTITUDE")]
LinkName: TypeAlias = Annotated[str, Meta(min_length=1, max_length=64)]
StampRule: TypeAlias = Literal["row0_mid", "row0_start", "row0_end"]

SERIAL_SHARE = 0.7
"""Default share of a serial line's capacity that outgoing bytes may use; the rest is for bursts."""
BITS_A_BYTE = 10
"""Bits for each byte on a serial line: a start bit, eight bits, a stop bit."""


class VehicleConfig(msgspec.Struct, frozen=True, kw_only=True):
    """[vehicle]: identity in the MAVLink network, and the interpretation of the autopilot's messages."""

    system_id: Annotated[int, Meta(ge=0, le=255)] = 0
    """MAVLink system id of the vehicle; 0 adopts the only autopilot that is heard."""
    component_id: Annotated[int, Meta(ge=2, le=255)] = 191
    """MAVLink component id of this service; 1 is the autopilot's."""
    position: Literal["auto", "none"] = "auto"
    """``auto``: the global position, else the autopilot's local one where its filter vouches for it, else none.
    ``none``: targets are relative to the point below the camera."""
    local_drift: Annotated[float, Meta(ge=0, le=1)] = 0.01
    """Drift of a local position, one sigma, of the way flown."""
    attitude_message: Literal["auto", "ATTITUDE", "ATTITUDE_QUATERNION"] = "auto"
    """Message that is used; ``auto``: ATTITUDE_QUATERNION once it is heard, ATTITUDE before or if it is refused."""
    position_delay_s: Annotated[float, Meta(ge=0, le=10)] = 0.0
    """Age of a position at its stamp, seconds."""


class LinkConfig(msgspec.Struct, frozen=True, kw_only=True):
    """One [[link]]: a MAVLink connection."""

    name: LinkName
    """Name in logs and in the status file; unique."""
    url: Annotated[str, Meta(description=LINK_FORMS)]
    """serial://, udpin://, udpout://, udpbcast://, tcpin:// or tcpout://."""
    role: Literal["autopilot", "gcs", "payload"]
    """Kind of peer at the other end. ``payload``: programs and devices of this vehicle, believed for their own
    components, never as the autopilot."""
    max_rate_hz: dict[MessageName, Positive] = {}
    """Largest rate at which a message leaves by this link, by message name, hertz."""
    forward_rate_requests: Literal["merge"] | bool = "merge"
    """Handling of a station's requests for message rates. ``merge``: they pass, our own higher rates follow, and each
    link gets what was asked for on it; true: they pass unchanged; false: they stop here."""
    relay_unsigned: bool = False
    """With a key, on a link in [signing] accept_unsigned: whether unsigned frames that ask something of their receiver,
    steer it, or on a gcs link stand for its sensors go from this link to the vehicle."""
    max_bytes_per_s: NotNegative = 0.0
    """Largest number of bytes a second that leave by this link; 0: 70 % of the baud rate on serial, else no limit."""

    @property
    def parsed_url(self) -> LinkUrl:
        """The parsed URL; its form was checked when the file was read."""
        return parse_link_url(self.url)

    @property
    def baud(self) -> int | None:
        """Baud rate of a serial link; None for any other."""
        url = self.parsed_url
        return url.baud if isinstance(url, SerialUrl) else None

    @property
    def byte_budget(self) -> float:
        """Largest number of bytes a second that leave by this link; 0: no limit."""
        url = self.parsed_url
        if self.max_bytes_per_s > 0.0 or not isinstance(url, SerialUrl):
            return self.max_bytes_per_s
        return SERIAL_SHARE * url.baud / BITS_A_BYTE


class SigningConfig(msgspec.Struct, frozen=True, kw_only=True):
    """[signing]: if present, frames are signed and unsigned ones refused."""

    key_file: Annotated[str, Meta(min_length=1)] = "signing.key"
    """Path of the key, 32 bytes, mode 0600."""
    accept_unsigned: tuple[LinkName, ...] = ()
    """Names of links on which unsigned telemetry is still accepted; unsigned commands never are."""


class RatesConfig(msgspec.Struct, frozen=True, kw_only=True):
    """[rates]: rates requested of the autopilot."""

    attitude: Annotated[float, Meta(gt=0, le=1000)] = 100.0
    """Rate of the attitude, hertz; at least ten times the flapping."""
    position: Annotated[float, Meta(gt=0, le=1000)] = 10.0
    """Rate of the position, hertz."""


class MountConfig(msgspec.Struct, frozen=True, kw_only=True):
    """[camera.mount]: Rz(yaw) Ry(pitch) Rx(roll) of a camera that looks along body x, image right = body right."""

    roll_deg: AngleDeg = 0.0
    """Roll angle, degrees."""
    pitch_deg: AngleDeg = -90.0
    """Pitch angle, degrees; -90 looks straight down, the image's top toward the nose."""
    yaw_deg: AngleDeg = 0.0
    """Yaw angle, degrees."""
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Camera position in body FRD, metres."""
    gimbal_device_id: Annotated[int, Meta(ge=0, le=255)] = 0
    """Gimbal that carries the camera, by its GIMBAL_DEVICE_ATTITUDE_STATUS: 1 to 6 for one behind the autopilot, else
    its MAVLink component (154); 0: the camera is fixed to the body. On a gimbal the angles count from the gimbal's own
    axes, all 0 for a camera that looks where the gimbal does; attitude and mount in [uncertainty] are the gimbal's."""
    gimbal_yaw_bias_deg: Annotated[float, Meta(ge=0, le=180)] = 3.0
    """One sigma of a gimbal's own heading: of its yaw zero on the vehicle, or of its compass, degrees."""
    levelled: Literal["auto"] | bool = "auto"
    """Whether a gimbal's reported roll and pitch count from the horizon; ``auto``: by its flags, checked by the motion;
    false: they count from the body."""
    gimbal_delay_s: Annotated[float, Meta(ge=0, le=1)] = 0.0
    """Age of a gimbal's attitude at its stamp, seconds; its sigma is 0.05."""

    @property
    def angles(self) -> Vector3:
        """Roll, pitch and yaw, degrees."""
        return (self.roll_deg, self.pitch_deg, self.yaw_deg)

    @property
    def body_from_camera(self) -> Matrix3:
        """The rotation of the three angles; on a gimbal, into the gimbal's own axes."""
        return body_from_camera_from_euler(radians(self.roll_deg), radians(self.pitch_deg), radians(self.yaw_deg))

    @property
    def lever_arm_m(self) -> Vector3:
        """The camera's centre in body FRD, metres."""
        return self.position_m


class CameraConfig(msgspec.Struct, frozen=True, kw_only=True):
    """[camera]: the lens, the exposure time of its rows, and its mount."""

    calibration: str = ""
    """Path of the calibration file; required where pixels are to be localized."""
    stamp: Literal["auto", StampRule] = "auto"
    """Instant that a frame's stamp marks; ``auto`` by the source of the frames."""
    exposure_s: Annotated[float, Meta(ge=0, le=1)] = 0.0
    """Exposure of one row, seconds, where frames do not carry their own."""
    time_offset_s: Annotated[float, Meta(ge=-10, le=10)] = 0.0
    """Delay of the stamps, seconds: positive where they come late."""
    readout_s: Literal["unknown"] | Annotated[float, Meta(ge=-1, le=1)] = "unknown"
    """Time from the first row to the last, seconds; 0: global shutter; negative: rows are read from the bottom."""
    mount: MountConfig = MountConfig()
    """Mount of the camera on the body."""

    @property
    def known_readout_s(self) -> float | None:
        """The time from the first row to the last, seconds; None where it is unknown."""
        return None if isinstance(self.readout_s, str) else self.readout_s

    def stamp_rule(self, *, libcamera_on_raspberry_pi: bool) -> StampRule:
        """The instant that a stamp marks. libcamera stamps a Raspberry Pi's frame when row 0 has been read."""
        if self.stamp != "auto":
            return self.stamp
        return "row0_end" if libcamera_on_raspberry_pi else "row0_mid"


class DetectionsConfig(msgspec.Struct, frozen=True, kw_only=True):
    """[detections]: pixels from another process."""

    url: str = "udpin://127.0.0.1:14601"
    """udpin://HOST:PORT or unix:///PATH; "": no detections are received."""
    min_score: float = 0.0
    """Least score of a detection that is used."""
    labels: tuple[str, ...] = ()
    """Labels of the detections that are used; empty: all."""

    @property
    def parsed_url(self) -> UdpUrl | UnixUrl | None:
        """The parsed URL at which detections arrive; None without one."""
        return parse_detections_url(self.url) if self.url else None
