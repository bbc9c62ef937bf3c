"""Sources of pictures: one module per kind, each behind :class:`fwav_companion.vision.images.Source`."""

from __future__ import annotations

import stat
from pathlib import Path

from fwav_companion.vision.detectors import needs_color
from fwav_companion.vision.images import Source, SourceLostError
from fwav_companion.vision.newest_picture import NewestPicture
from fwav_companion.vision.source_names import SourceKind, source_kind
from fwav_companion.vision.task import VisionTask


def open_source(task: VisionTask) -> Source:
    """The open source that [vision] source names; the kind of a path follows from its file. SourceLostError.

    Cameras, streams and pipes deliver their newest picture, a folder and a video one picture after another.
    """
    match source_kind(task.source):
        case SourceKind.LIBCAMERA:
            from fwav_companion.vision.sources.libcamera import LibcameraSource

            return NewestPicture(LibcameraSource(task, color=needs_color(task)))
        case SourceKind.STREAM:
            from fwav_companion.vision.sources.stream import StreamSource

            return NewestPicture(StreamSource(task.source, utc=task.stream_clock == "utc"))
        case SourceKind.DEVICE:
            from fwav_companion.vision.sources.capture import DeviceSource

            return NewestPicture(DeviceSource(task))
        case SourceKind.PATH:
            return _open_path(Path(task.source))


def _open_path(path: Path) -> Source:
    try:
        mode = path.stat().st_mode
    except OSError as error:
        raise SourceLostError(f"{path}: {error.strerror}") from None
    if stat.S_ISFIFO(mode):
        from fwav_companion.vision.sources.pipe import PipeSource

        return NewestPicture(PipeSource(path))
    if stat.S_ISDIR(mode):
        from fwav_companion.vision.sources.folder import FolderSource

        return FolderSource(path)
    from fwav_companion.vision.sources.capture import VideoSource

    return VideoSource(str(path))
