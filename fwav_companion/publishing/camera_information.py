"""What the camera component says about itself when it is asked."""

from __future__ import annotations

from math import nan
from typing import Any

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.publishing import enums
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.target_report import boot_ms

VENDOR = "fwav-companion"
MODEL = "target localization"
STREAM = 1
"""The one stream's number: they count from 1."""
VIDEO_TYPES = {
    "rtsp": enums.VIDEO_STREAM_TYPE_RTSP,
    "udp": enums.VIDEO_STREAM_TYPE_RTPUDP,
    "rtp": enums.VIDEO_STREAM_TYPE_RTPUDP,
    "tcp": enums.VIDEO_STREAM_TYPE_TCP_MPEG,
    "mpegts": enums.VIDEO_STREAM_TYPE_MPEG_TS,
}
"""By the URI's scheme; RTSP where it tells nothing."""
URI_BYTES = 160


def camera_information(options: PublishOptions, now: HostNs) -> dict[str, Any]:
    """CAMERA_INFORMATION (259), with the tracking flags; no definition file, and no optics that nobody told us."""
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
    }


def camera_settings(_options: PublishOptions, now: HostNs) -> dict[str, Any]:
    """CAMERA_SETTINGS (260): it only ever looks."""
    return {
        "time_boot_ms": boot_ms(now),
        "mode_id": enums.CAMERA_MODE_VIDEO,
        "zoomLevel": nan,
        "focusLevel": nan,
    }


def camera_capture_status(_options: PublishOptions, now: HostNs) -> dict[str, Any]:
    """CAMERA_CAPTURE_STATUS (262): it takes no pictures and no film for anybody."""
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
    return {
        "stream_id": STREAM,
        "count": 1,
        "type": VIDEO_TYPES.get(scheme, enums.VIDEO_STREAM_TYPE_RTSP),
        "name": MODEL,
        "uri": options.video_uri.encode()[:URI_BYTES].decode(errors="ignore"),
        **_stream(options),
    }


def video_stream_status(options: PublishOptions, _now: HostNs) -> dict[str, Any] | None:
    """VIDEO_STREAM_STATUS (270); None without a video_uri."""
    return {"stream_id": STREAM, **_stream(options)} if options.video_uri else None


def _stream(options: PublishOptions) -> dict[str, Any]:
    """Somebody else makes the stream: of its format no more is known than that it shows this camera's picture."""
    return {
        "flags": enums.VIDEO_STREAM_STATUS_FLAGS_RUNNING,
        "framerate": 0.0,
        "resolution_h": options.image_size[0],
        "resolution_v": options.image_size[1],
        "bitrate": 0,
        "rotation": 0,
        "hfov": 0,
    }


def _bytes32(text: str) -> tuple[int, ...]:
    return tuple(text.encode()[:32].ljust(32, b"\0"))
