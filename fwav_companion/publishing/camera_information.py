"""Descriptions of the camera for ground stations: CAMERA_INFORMATION and what they request after it. Pure.

QGroundControl requests CAMERA_INFORMATION, CAMERA_SETTINGS, STORAGE_INFORMATION, CAMERA_CAPTURE_STATUS and the video
streams, by the older commands and, in newer versions, by MAV_CMD_REQUEST_MESSAGE; it repeats a request that fails three
times. Mission Planner requests CAMERA_INFORMATION and VIDEO_STREAM_INFORMATION.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from math import atan2, degrees, nan
from typing import Any

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.publishing import enums
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.target_report import boot_ms
from fwav_companion.types.camera import Lens, NoRay

VENDOR = "fwav-companion"
MODEL = "target localization"
STREAM = STORAGE = 1
"""Number of the only stream and of the only storage: both count from 1."""
VIDEO_TYPES = {
    "rtsp": enums.VIDEO_STREAM_TYPE_RTSP,
    "udp": enums.VIDEO_STREAM_TYPE_RTPUDP,
    "udp265": enums.VIDEO_STREAM_TYPE_RTPUDP,
    "rtp": enums.VIDEO_STREAM_TYPE_RTPUDP,
    "tcp": enums.VIDEO_STREAM_TYPE_TCP_MPEG,
    "mpegts": enums.VIDEO_STREAM_TYPE_MPEG_TS,
}
"""Stream type by the URI's scheme; RTSP for every other scheme."""
ENCODINGS = {"udp265": enums.VIDEO_STREAM_ENCODING_H265}
"""Encoding by the URI's scheme, as QGroundControl writes it; unknown for every other scheme."""
BY_PORT = frozenset({enums.VIDEO_STREAM_TYPE_RTPUDP, enums.VIDEO_STREAM_TYPE_MPEG_TS})
"""Stream types whose URI is only the port number (common.xml). QGroundControl before 5.0 prepends
``udp://0.0.0.0:``."""
URI_BYTES = 160


def camera_information(options: PublishOptions, now: HostNs) -> dict[str, Any]:
    """CAMERA_INFORMATION (259) with the tracking flags; no definition file, and unknown optics as NaN."""
    major, minor, patch = options.version
    flags = (
        enums.CAMERA_CAP_FLAGS_HAS_TRACKING_POINT
        | enums.CAMERA_CAP_FLAGS_HAS_TRACKING_RECTANGLE
        | enums.CAMERA_CAP_FLAGS_HAS_TRACKING_GEO_STATUS
    )
    return {
        "time_boot_ms": boot_ms(now),
        "vendor_name": _bytes32(VENDOR),
        "model_name": _bytes32(MODEL),
        "firmware_version": (patch & 0xFF) << 16 | (minor & 0xFF) << 8 | (major & 0xFF),
        "focal_length": nan,
        "sensor_size_h": nan,
        "sensor_size_v": nan,
        "resolution_h": options.image_size[0],
        "resolution_v": options.image_size[1],
        "lens_id": 0,
        "flags": flags | (enums.CAMERA_CAP_FLAGS_HAS_VIDEO_STREAM if options.video_uri else 0),
        "cam_definition_version": 0,
        "cam_definition_uri": "",
        "gimbal_device_id": options.gimbal_device_id,
    }


def camera_settings(_options: PublishOptions, now: HostNs) -> dict[str, Any]:
    """CAMERA_SETTINGS (260): always video mode, without zoom or focus."""
    return {
        "time_boot_ms": boot_ms(now),
        "mode_id": enums.CAMERA_MODE_VIDEO,
        "zoomLevel": nan,
        "focusLevel": nan,
    }


def storage_information(_options: PublishOptions, now: HostNs) -> dict[str, Any]:
    """STORAGE_INFORMATION (261): not supported, so that a station shows no capacity.

    After a refusal QGroundControl would repeat its request. The recording's files are not pictures for the operator.
    """
    return {
        "time_boot_ms": boot_ms(now),
        "storage_id": STORAGE,
        "storage_count": 1,
        "status": enums.STORAGE_STATUS_NOT_SUPPORTED,
        "total_capacity": 0.0,
        "used_capacity": 0.0,
        "available_capacity": 0.0,
        "read_speed": 0.0,
        "write_speed": 0.0,
    }


def camera_capture_status(_options: PublishOptions, now: HostNs) -> dict[str, Any]:
    """CAMERA_CAPTURE_STATUS (262): idle; the camera takes no pictures or videos on command."""
    return {
        "time_boot_ms": boot_ms(now),
        "image_status": 0,
        "video_status": 0,
        "image_interval": 0.0,
        "recording_time_ms": 0,
        "available_capacity": 0.0,
        "image_count": 0,
    }


def video_stream_information(options: PublishOptions, _now: HostNs) -> dict[str, Any] | None:
    """VIDEO_STREAM_INFORMATION (269); None without a video_uri."""
    if not options.video_uri:
        return None
    scheme = options.video_uri.partition("://")[0].lower()
    kind = VIDEO_TYPES.get(scheme, enums.VIDEO_STREAM_TYPE_RTSP)
    uri = _port(options.video_uri) if kind in BY_PORT else options.video_uri
    return {
        "stream_id": STREAM,
        "count": 1,
        "type": kind,
        "name": MODEL,
        "uri": uri.encode()[:URI_BYTES].decode(errors="ignore"),
        "encoding": ENCODINGS.get(scheme, enums.VIDEO_STREAM_ENCODING_UNKNOWN),
        **_stream(options),
    }


def video_stream_status(options: PublishOptions, _now: HostNs) -> dict[str, Any] | None:
    """VIDEO_STREAM_STATUS (270); None without a video_uri."""
    return {"stream_id": STREAM, **_stream(options)} if options.video_uri else None


DESCRIPTIONS: dict[int, tuple[str, Callable[[PublishOptions, HostNs], dict[str, Any] | None]]] = {
    enums.CAMERA_INFORMATION: ("CAMERA_INFORMATION", camera_information),
    enums.CAMERA_SETTINGS: ("CAMERA_SETTINGS", camera_settings),
    enums.STORAGE_INFORMATION: ("STORAGE_INFORMATION", storage_information),
    enums.CAMERA_CAPTURE_STATUS: ("CAMERA_CAPTURE_STATUS", camera_capture_status),
    enums.VIDEO_STREAM_INFORMATION: ("VIDEO_STREAM_INFORMATION", video_stream_information),
    enums.VIDEO_STREAM_STATUS: ("VIDEO_STREAM_STATUS", video_stream_status),
}
"""Name and fields of each message that may be requested, by its id."""
NUMBERED = frozenset({enums.STORAGE_INFORMATION, enums.VIDEO_STREAM_INFORMATION, enums.VIDEO_STREAM_STATUS})
"""Messages for which param2 of MAV_CMD_REQUEST_MESSAGE is a number, 0 for all."""
OLD_REQUESTS = {
    enums.MAV_CMD_REQUEST_CAMERA_INFORMATION: enums.CAMERA_INFORMATION,
    enums.MAV_CMD_REQUEST_CAMERA_SETTINGS: enums.CAMERA_SETTINGS,
    enums.MAV_CMD_REQUEST_STORAGE_INFORMATION: enums.STORAGE_INFORMATION,
    enums.MAV_CMD_REQUEST_CAMERA_CAPTURE_STATUS: enums.CAMERA_CAPTURE_STATUS,
    enums.MAV_CMD_REQUEST_VIDEO_STREAM_INFORMATION: enums.VIDEO_STREAM_INFORMATION,
    enums.MAV_CMD_REQUEST_VIDEO_STREAM_STATUS: enums.VIDEO_STREAM_STATUS,
}
"""Commands that MAV_CMD_REQUEST_MESSAGE replaced. param1 is the number, or 1; Mission Planner always sends 0."""


def horizontal_fov_deg(lens: Lens) -> float:
    """Angle between the rays of the left and the right edge in the middle row, degrees.

    An edge beyond the valid range of the lens counts as its largest valid angle.
    """
    width, height = lens.image_size
    edges = [lens.camera_ray_from_pixel(u, (height - 1) / 2) for u in (-0.5, width - 0.5)]
    return degrees(sum(lens.max_angle if isinstance(ray, NoRay) else atan2(abs(ray[0]), ray[2]) for ray in edges))


def vertical_fov_deg(lens: Lens) -> float:
    """Angle between the rays of the upper and the lower edge in the middle column, degrees; as above."""
    width, height = lens.image_size
    edges = [lens.camera_ray_from_pixel((width - 1) / 2, v) for v in (-0.5, height - 0.5)]
    return degrees(sum(lens.max_angle if isinstance(ray, NoRay) else atan2(abs(ray[1]), ray[2]) for ray in edges))


def _stream(options: PublishOptions) -> dict[str, Any]:
    """Fields common to both stream messages. Another program makes the stream, so its format is not known here."""
    return {
        "flags": enums.VIDEO_STREAM_STATUS_FLAGS_RUNNING,
        "framerate": 0.0,
        "resolution_h": options.image_size[0],
        "resolution_v": options.image_size[1],
        "bitrate": 0,
        "rotation": 0,
        "hfov": round(options.hfov_deg),
    }


def _port(uri: str) -> str:
    """The port number of a URI; the URI itself where it has none."""
    match = re.search(r"(?:^|:)(\d{1,5})(?:[/?#]|$)", uri.partition("://")[2])
    return uri if match is None else match[1]


def _bytes32(text: str) -> tuple[int, ...]:
    return tuple(text.encode()[:32].ljust(32, b"\0"))
