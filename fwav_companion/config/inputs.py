"""What comes in: the vehicle, its links, the camera and the detections. Units as in the file; rooms get SI."""

from __future__ import annotations

from math import radians
from typing import Annotated, Literal, TypeAlias

import msgspec
from msgspec import Meta

from fwav_companion.geometry.mounts import body_from_camera_from_euler
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.links.url import LinkUrl, UdpUrl, UnixUrl, parse_detections_url, parse_link_url

Positive: TypeAlias = Annotated[float, Meta(gt=0)]
NotNegative: TypeAlias = Annotated[float, Meta(ge=0)]
AngleDeg: TypeAlias = Annotated[float, Meta(ge=-360, le=360)]
MessageName: TypeAlias = Annotated[str, Meta(pattern=r"^[A-Z][A-Z0-9_]*$", description="a message name, as ATTITUDE")]
LinkName: TypeAlias = Annotated[str, Meta(min_length=1, max_length=64)]
StampRule: TypeAlias = Literal["row0_mid", "row0_start", "row0_end"]


class Section(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of the file: a key that no field bears is an error."""


class VehicleConfig(Section, frozen=True):
    """[vehicle]: whom we fly with, and how its messages are read."""

    system_id: Annotated[int, Meta(ge=0, le=255)] = 0
    """MAVLink system id; 0 adopts the one autopilot that is heard."""
    component_id: Annotated[int, Meta(ge=2, le=255)] = 191
    """MAVLink component id of this service; 1 is the autopilot's."""
    position: Literal["auto", "none"] = "auto"
    """``none``: targets are relative to the point below the camera."""
    attitude_message: Literal["auto", "ATTITUDE", "ATTITUDE_QUATERNION"] = "auto"
    """``auto``: ATTITUDE_QUATERNION once it is heard, ATTITUDE until then or where it is refused."""
    position_delay_s: Annotated[float, Meta(ge=0, le=10)] = 0.0
    """How old a position is against its stamp, seconds."""


class LinkConfig(Section, frozen=True):
    """One [[link]]: a way in and out for MAVLink."""

    name: LinkName
    """How logs and the status file call it; unique."""
    url: str
    """serial://, udpin://, udpout://, udpbcast://, tcpin:// or tcpout://."""
    role: Literal["autopilot", "gcs"]
    """Who is at the other end."""
    max_rate_hz: dict[MessageName, Positive] = {}
    """By message name: thinned to this on the way out of this link, hertz."""
    forward_rate_requests: bool = False
    """Whether a ground station's REQUEST_DATA_STREAM passes on from this link."""

    @property
    def parsed_url(self) -> LinkUrl:
        """The URL, parsed; it was found good when the file was read."""
        return parse_link_url(self.url)


class SigningConfig(Section, frozen=True):
    """[signing]: present, frames are signed and unsigned ones refused."""

    key_file: Annotated[str, Meta(min_length=1)] = "signing.key"
    """Path of the 32 bytes of the key, mode 0600."""
    accept_unsigned: tuple[LinkName, ...] = ()
    """Names of links on which unsigned telemetry is still accepted; unsigned commands never are."""


class RatesConfig(Section, frozen=True):
    """[rates]: what is asked of the autopilot."""

    attitude: Annotated[float, Meta(gt=0, le=1000)] = 100.0
    """Hertz; ten times the flapping, at least."""
    position: Annotated[float, Meta(gt=0, le=1000)] = 10.0
    """Hertz."""


class MountConfig(Section, frozen=True):
    """[camera.mount]: Rz(yaw) Ry(pitch) Rx(roll) of a camera that looks along body x, image right = body right."""

    roll_deg: AngleDeg = 0.0
    """Degrees."""
    pitch_deg: AngleDeg = -90.0
    """Degrees; -90 looks straight down, the image's top toward the nose."""
    yaw_deg: AngleDeg = 0.0
    """Degrees."""
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of the camera in body FRD, metres."""
    gimbal_device_id: Annotated[int, Meta(ge=0, le=255)] = 0
    """0: fixed to the body. Else it is carried by the gimbal whose GIMBAL_DEVICE_ATTITUDE_STATUS this is: 1 to 6 for
    one behind the autopilot, else its MAVLink component (154). The angles then count from the gimbal's own axes, all 0
    for a camera that looks where the gimbal does, and [uncertainty]'s of attitude and mount are the gimbal's."""

    @property
    def angles(self) -> Vector3:
        """The three angles, degrees."""
        return (self.roll_deg, self.pitch_deg, self.yaw_deg)

    @property
    def body_from_camera(self) -> Matrix3:
        """The rotation that the three angles stand for; of a camera on a gimbal, in the gimbal's own axes."""
        return body_from_camera_from_euler(radians(self.roll_deg), radians(self.pitch_deg), radians(self.yaw_deg))

    @property
    def lever_arm_m(self) -> Vector3:
        """The camera's centre in body FRD, metres."""
        return self.position_m


class CameraConfig(Section, frozen=True):
    """[camera]: the lens, when its rows are exposed, and how it is mounted."""

    calibration: str = ""
    """Path of the calibration file; required where pixels are to be localized."""
    stamp: Literal["auto", StampRule] = "auto"
    """What a frame's stamp marks; ``auto`` by the source of the frames."""
    exposure_s: Annotated[float, Meta(ge=0, le=1)] = 0.0
    """Exposure of one row, seconds, where frames do not carry their own."""
    time_offset_s: Annotated[float, Meta(ge=-10, le=10)] = 0.0
    """How late the stamps come, seconds."""
    readout_s: Literal["unknown"] | Annotated[float, Meta(ge=-1, le=1)] = "unknown"
    """From the first row to the last, seconds; 0: global shutter; negative: rows are read from the bottom."""
    mount: MountConfig = MountConfig()
    """How it sits on the body."""

    @property
    def known_readout_s(self) -> float | None:
        """Seconds from the first row to the last; None where it is not known."""
        return None if isinstance(self.readout_s, str) else self.readout_s

    def stamp_rule(self, *, libcamera_on_raspberry_pi: bool) -> StampRule:
        """What a stamp marks, ``auto`` resolved: libcamera stamps a Raspberry Pi's frame when row 0 has been read."""
        if self.stamp != "auto":
            return self.stamp
        return "row0_end" if libcamera_on_raspberry_pi else "row0_mid"


class DetectionsConfig(Section, frozen=True):
    """[detections]: pixels from another process."""

    url: str = "udpin://127.0.0.1:14601"
    """udpin://HOST:PORT or unix:///PATH; "" for none."""
    min_score: float = 0.0
    """Detections that score less are not used."""
    labels: tuple[str, ...] = ()
    """Only these labels are used; empty: all."""

    @property
    def parsed_url(self) -> UdpUrl | UnixUrl | None:
        """Where they arrive; None for nowhere."""
        return parse_detections_url(self.url) if self.url else None


class VisionConfig(Section, frozen=True):
    """[vision]: present, this service opens a camera and looks for targets itself."""

    source: Annotated[str, Meta(min_length=1)] = "libcamera:0"
    """libcamera:N, /dev/videoN, a video file, a folder or named pipe of images with stamps, or rtsp://."""
    detector: Literal["apriltag", "aruco", "color", "onnx"] = "apriltag"
    """What looks at the images."""
    aruco_dictionary: Annotated[str, Meta(pattern=r"^[4-7]x[4-7]_(50|100|250|1000)$")] = "4x4_50"
    """For aruco: OpenCV's name of it in small letters."""
    color_hue_deg: AngleDeg = 0.0
    """For color, degrees: 0 red, 60 yellow, 120 green, 240 blue."""
