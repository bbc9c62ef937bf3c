"""SHELL: the telemetry in a video's own tracks, by PyAV (extra `stream`): MISB KLV, Parrot's metadata, Autel's text."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.libraries import is_installed
from fwav_companion.photographs.klv import SensorState, TimeScale, centre_notes, decode_packets, row_of
from fwav_companion.photographs.parrot_metadata import RECORDS, parrot_row
from fwav_companion.photographs.srt import subtitle_row
from fwav_companion.photographs.telemetry_rows import TelemetryRow

MOST_BYTES: Final = 256 * 1024 * 1024
TRACKS: Final = ("data", "subtitle")
LENGTH_BYTES: Final = 2
"""A sample of MPEG-4 timed text begins with the length of its text."""


class EmbeddedTelemetry(msgspec.Struct, frozen=True):
    """What the tracks of a video say."""

    rows: tuple[TelemetryRow, ...] = ()
    notes: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()
    """Names of tracks that hold something else."""


def embedded_telemetry(path: Path, scale: TimeScale = TimeScale.AUTO) -> EmbeddedTelemetry:
    """Telemetry by times of the video; empty without PyAV. InputFileError for no video."""
    if not is_installed("av"):
        return EmbeddedTelemetry()
    import av

    rows: list[TelemetryRow] = []
    states: list[SensorState] = []
    read: set[int] = set()
    size = 0
    try:
        with av.open(str(path)) as container:
            opened: Any = container
            tracks = [stream for stream in opened.streams if stream.type in TRACKS]
            video = opened.streams.video[0] if opened.streams.video else None
            if not tracks or video is None:
                return EmbeddedTelemetry()
            begin_s = float(video.start_time * video.time_base) if video.start_time is not None else 0.0
            for packet in opened.demux(tracks):
                content = bytes(packet)
                size += len(content)
                if size > MOST_BYTES:
                    break
                if packet.pts is None:
                    continue
                found = list(_rows(content, max(0.0, float(packet.pts * packet.time_base) - begin_s), states, scale))
                rows += found
                if found:
                    read.add(packet.stream.index)
            unread = [_name(stream) for stream in tracks if stream.index not in read]
    except (av.error.FFmpegError, OSError, ValueError) as error:
        raise InputFileError(f"{path}: {str(error).splitlines()[0][:100]}; accepted: a video") from None
    notes = [*centre_notes(states), *_time_notes(states, scale)]
    return EmbeddedTelemetry(tuple(sorted(rows, key=lambda row: row.at_s)), tuple(notes), tuple(unread))


def _rows(content: bytes, at_s: float, states: list[SensorState], scale: TimeScale) -> Iterator[TelemetryRow]:
    """The rows of a sample, by what it contains."""
    row: TelemetryRow | None
    if content[:2] in RECORDS:
        row = parrot_row(content, at_s)
    elif b"GPS" in content:
        row = subtitle_row(at_s, at_s, content[LENGTH_BYTES:].decode("utf-8", "replace"))
    else:
        for state in decode_packets(content):
            row = row_of(state, at_s, scale)
            if row is not None:
                states.append(state)
                yield row
        return
    if row is not None and row.lat_deg is not None:
        yield row


def _time_notes(states: list[SensorState], scale: TimeScale) -> list[str]:
    if scale is not TimeScale.AUTO or not states or states[0].time_s is None:
        return []
    if states[0].leap_s is None:
        misp = "detect --klv-time misp where the encoder writes MISP time (37 s later)"
        return [f"the metadata's time is taken as UTC: {misp}"]
    return [f"the metadata's time is MISP time, {states[0].leap_s} s after UTC by its own word"]


def _name(stream: Any) -> str:
    name = stream.metadata.get("handler_name") or getattr(stream, "name", None) or stream.type
    return "".join(c for c in str(name) if c.isprintable())[:40]
