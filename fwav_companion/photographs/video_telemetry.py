"""SHELL: the telemetry of a video: a file beside it, or its own tracks. The one reader of `locate` and `detect`."""

from __future__ import annotations

from pathlib import Path
from statistics import median
from typing import Final

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.libraries import is_installed
from fwav_companion.on_disk import content
from fwav_companion.photographs.embedded_tracks import embedded_telemetry
from fwav_companion.photographs.flight_csv import parse_flight_csv
from fwav_companion.photographs.klv import TimeScale
from fwav_companion.photographs.srt import end_of_srt_s, parse_srt
from fwav_companion.photographs.telemetry_rows import TelemetryRow

SUBTITLES, TABLES = (".srt", ".ass"), (".csv",)
OTHER_VIDEO_S: Final = 2.0
"""Difference of the lengths of video and telemetry beyond which they do not belong together, seconds."""
LARGEST_FILE: Final = 512 * 1024 * 1024


class VideoTelemetry(msgspec.Struct, frozen=True):
    """The rows in the order of their times, at least one, each with a place."""

    rows: tuple[TelemetryRow, ...]
    source: str
    """Name of the file beside the video, or "the video's own track"."""
    notes: tuple[str, ...] = ()

    def start_unix(self) -> float | None:
        """UTC of the video's beginning; None where the telemetry has no such time."""
        starts = [row.time_unix - row.at_s for row in self.rows if row.time_unix is not None]
        return median(starts) if starts else None


def video_telemetry(path: Path, length_s: float, scale: TimeScale = TimeScale.AUTO) -> VideoTelemetry:
    """The telemetry of a video. InputFileError says what is missing, or that it is another video's."""
    beside = _beside(path)
    if beside is None:
        return _embedded(path, scale)
    if beside.stat().st_size > LARGEST_FILE:
        raise InputFileError(f"{beside}: {beside.stat().st_size} bytes; accepted: at most {LARGEST_FILE}")
    try:
        text = content(beside).decode("utf-8", "replace")
    except OSError as error:
        raise InputFileError(f"{beside}: {error.strerror}; accepted: a readable file") from None
    if beside.suffix.lower() in SUBTITLES:
        rows, end_s = parse_srt(text, str(beside)), end_of_srt_s(text)
    else:
        rows = parse_flight_csv(text, str(beside))
        end_s = rows[-1].until_s
    if length_s > 0.0 and abs(end_s - length_s) > OTHER_VIDEO_S:
        raise InputFileError(
            f"{beside}: it ends at {end_s:.1f} s, the video at {length_s:.1f} s: another video's; accepted: "
            f"the telemetry of {path.name}"
        )
    return VideoTelemetry(tuple(rows), beside.name)


def has_telemetry(path: Path) -> bool:
    """Whether a file of telemetry lies beside the video, or its tracks hold some."""
    return _beside(path) is not None or bool(embedded_telemetry(path).rows)


def _beside(path: Path) -> Path | None:
    suffixes = [way(suffix) for suffix in (*SUBTITLES, *TABLES) for way in (str.upper, str.lower)]
    return next((each for suffix in suffixes if (each := path.with_suffix(suffix)).is_file()), None)


def _embedded(path: Path, scale: TimeScale) -> VideoTelemetry:
    found = embedded_telemetry(path, scale)
    if found.rows:
        return VideoTelemetry(found.rows, "the video's own track", found.notes)
    tracks = "" if not found.unread else f' (track "{found.unread[0]}")'
    needs = "" if is_installed("av") else " (its tracks need the extra stream: pip install '.[stream]')"
    raise InputFileError(
        f"{path}: no {path.stem}.SRT, .ASS or .csv of Airdata or Litchi beside it, no KLV, Parrot or Autel track in it"
        f"{needs}; what DJI embeds{tracks} exiftool -ee gives as text"
    )
