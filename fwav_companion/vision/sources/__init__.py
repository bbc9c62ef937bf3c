"""Sources of pictures: one module per kind, each behind :class:`fwav_companion.vision.images.Source`."""

from __future__ import annotations

import re
import stat
from pathlib import Path

from fwav_companion.vision.images import Source, SourceLostError

ACCEPTED = "libcamera:0 | /dev/video0 | rtsp://HOST/PATH | a video file | a folder or pipe of pictures"


def open_source(text: str) -> Source:
    """The open source that [vision] source names; the kind of a path follows from its file. SourceLostError."""
    if match := re.fullmatch(r"libcamera:(\d+)", text):
        from fwav_companion.vision.sources.libcamera import LibcameraSource

        return LibcameraSource(int(match[1]))
    if text.startswith(("rtsp://", "rtsps://")):
        from fwav_companion.vision.sources.capture import StreamSource

        return StreamSource(text)
    if text.startswith("/dev/video"):
        from fwav_companion.vision.sources.capture import DeviceSource

        return DeviceSource(text)
    if re.match(r"libcamera:|\w+:/", text):
        raise SourceLostError(f"{text}: unknown kind of source; accepted: {ACCEPTED}")
    return _open_path(Path(text))


def _open_path(path: Path) -> Source:
    try:
        mode = path.stat().st_mode
    except OSError as error:
        raise SourceLostError(f"{path}: {error.strerror}") from None
    if stat.S_ISFIFO(mode):
        from fwav_companion.vision.sources.pipe import PipeSource

        return PipeSource(path)
    if stat.S_ISDIR(mode):
        from fwav_companion.vision.sources.folder import FolderSource

        return FolderSource(path)
    from fwav_companion.vision.sources.capture import VideoSource

    return VideoSource(str(path))
