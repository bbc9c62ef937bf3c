"""The options of the publisher: the [publish] table of the configuration, and the facts of this installation."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from fwav_companion.geometry.vectors import ZERO3, Vector3
from fwav_companion.types.secrets import SecretUrl


class PublishTable(msgspec.Struct, frozen=True, kw_only=True):
    """[publish]: which target is reported to which receivers."""

    select: Literal["best", "operator"] = "best"
    """``best``: the oldest confirmed track; ``operator``: only the track that the operator clicked."""
    label: str = ""
    """Label of the tracks that may be selected; "": any."""
    rate_hz: Annotated[float, Meta(gt=0, le=100)] = 10.0
    """Rate of the tracking messages, hertz."""
    camera_tracking: bool = True
    """Whether the camera component with its tracking messages is on."""
    landing_target: bool = False
    """Whether LANDING_TARGET steers the autopilot's landing."""
    landing_label: str = ""
    """Label of the landing target, required with landing_target: its oldest confirmed track is sent."""
    landing_max_sigma_m: Annotated[float, Meta(gt=0)] = 0.5
    """Largest sigma of the landing target relative to the vehicle, larger semi-axis, metres, at which it is sent."""
    distance_sensor: bool = False
    """Whether DISTANCE_SENSOR is sent from the size of a tag alone, for vehicles without a rangefinder."""
    statustext: bool = True
    """Whether texts are sent: target found, target lost, trouble, ready."""
    named_values: bool = True
    """Whether NAMED_VALUE_FLOAT is sent, for Mission Planner's quick view."""
    adsb: bool = False
    """Whether ADSB_VEHICLE is sent as a map marker, on gcs links only."""
    cot: str = ""
    """URL to which Cursor on Target is sent, for example udpout://239.2.3.1:6969 or tls://HOST:8089; "": it is not
    sent, or goes to the server of cot_package."""
    cot_client_cert: str = ""
    """This unit's certificate for tls://: a PEM or .p12 file; "": none."""
    cot_client_key: str = ""
    """Its private key, a PEM file; "": the key is in the file of the certificate."""
    cot_password_file: str = ""
    """File with the password of the key or .p12; "": no password."""
    cot_ca: str = ""
    """Authority that signed the server's certificate, PEM or .p12; "": the system's authorities."""
    cot_server_name: str = ""
    """Name expected in the server's certificate; "": the URL's host."""
    cot_package: str = ""
    """TAK data package (.zip) in place of the five keys above, and of cot where that is empty."""
    cot_vehicle: bool = True
    """Whether the vehicle, its camera's view and the point it looks at are sent, too."""
    cot_type: Annotated[str, Meta(pattern=r"^[a-z](-[A-Za-z0-9]+)+$", description="a CoT type, as a-u-G")] = "a-u-G"
    """Type of the Cursor on Target event."""
    cot_callsign: str = ""
    """Name of the selected target and of the vehicle on the map; "": label and number."""
    cot_rate_hz: Annotated[float, Meta(gt=0, le=10)] = 1.0
    """Rate of the events of each marker, hertz."""
    cot_stale_s: Annotated[float, Meta(gt=0)] = 10.0
    """Validity of the events of the vehicle and its camera's view, seconds."""
    cot_target_stale_s: Annotated[float, Meta(gt=0)] = 3600.0
    """Validity of a target's event after its last fix, seconds. Only merged tracks are deleted earlier."""
    video_uri: SecretUrl = ""
    """Video stream reported to ground stations, so that they offer tracking on the picture; "": no stream."""
    video_delay_s: Annotated[float, Meta(ge=0, le=30)] = 0.3
    """Delay of the picture that the operator clicks, seconds."""


class PublishOptions(PublishTable, frozen=True, kw_only=True):
    """The [publish] table, and the facts of this installation that the publisher needs."""

    image_size: tuple[int, int] = (0, 0)
    """Width and height of the calibration, pixels; (0, 0) without a camera."""
    hfov_deg: float = 0.0
    """Horizontal field of view from the calibration, degrees; 0: unknown."""
    vfov_deg: float = 0.0
    """Vertical field of view, degrees; 0: unknown."""
    gimbal_device_id: int = 0
    """Gimbal that carries the camera, as [camera.mount] has it; 0: no gimbal."""
    camera_position_m: Vector3 = ZERO3
    """Camera position in body FRD, metres. Without a global position targets are relative to the camera."""
    companion_component: int = 191
    """MAVLink component id of this service."""
    camera_component: int = 100
    """MAVLink component id of its camera."""
    version: tuple[int, int, int] = (0, 0, 0)
    """Version of this package: the camera's firmware version."""
    unit: str = ""
    """Permanent name of this board, the start of its machine id. It keeps the uid of Cursor on Target the same after a
    restart."""
