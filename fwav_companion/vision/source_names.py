"""The kinds of [vision] source by their names. PURE, shared by the configuration and the vision process."""

from __future__ import annotations

import re
from enum import StrEnum
from urllib.parse import urlsplit

ACCEPTED = (
    "libcamera:N | /dev/videoN | rtsp://HOST/PATH | udp://HOST:PORT (MPEG-TS) | a .sdp file (RTP) | a video file | "
    "a folder or pipe of pictures"
)


class SourceKind(StrEnum):
    """Kinds of sources."""

    LIBCAMERA = "libcamera"
    DEVICE = "device"
    """A V4L2 device."""
    STREAM = "stream"
    """A stream of the network: RTSP, MPEG-TS over UDP, or RTP by an SDP file."""
    PATH = "path"
    """A video file, a folder or a named pipe."""


def source_kind(text: str) -> SourceKind:
    """The kind of a source. ValueError with the accepted names if no kind has such a name."""
    if re.fullmatch(r"libcamera:[0-9]{1,3}", text):
        return SourceKind.LIBCAMERA
    if text.startswith("/dev/video"):
        return SourceKind.DEVICE
    if text.startswith(("rtsp://", "rtsps://", "udp://")):
        _require_host(text)
        return SourceKind.STREAM
    if text.startswith("libcamera:") or re.match(r"[A-Za-z][A-Za-z0-9+.-]*:/", text):
        raise ValueError(f"unknown kind of source; accepted: {ACCEPTED}")
    return SourceKind.STREAM if text.endswith(".sdp") else SourceKind.PATH


def is_file_name(text: str) -> bool:
    """Whether a source is a path of the file system, which is relative to the configuration's folder."""
    return source_kind(text) is SourceKind.PATH or text.endswith(".sdp")


def _require_host(text: str) -> None:
    try:
        parts = urlsplit(text)
        has_port = parts.port is not None
    except ValueError:
        raise ValueError(f"not an address; accepted: {ACCEPTED}") from None
    if not parts.hostname:
        raise ValueError(f"no host; accepted: {ACCEPTED}")
    if parts.scheme == "udp" and not has_port:
        raise ValueError("no port; accepted: udp://HOST:PORT, as udp://0.0.0.0:5600")
