"""SHELL: the KLV metadata in a video's data streams, by PyAV (extra `stream`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fwav_companion.errors import InputFileError
from fwav_companion.libraries import is_installed
from fwav_companion.photographs.klv import SensorState, decode_packets, row_of
from fwav_companion.photographs.srt import SubtitleRow

MOST_BYTES = 256 * 1024 * 1024


def klv_rows(path: Path) -> tuple[list[SubtitleRow], list[SensorState]]:
    """Telemetry by times of the video, and the states behind it; empty without KLV. InputFileError for no video."""
    if not is_installed("av"):
        return [], []
    import av

    rows: list[SubtitleRow] = []
    states: list[SensorState] = []
    size = 0
    try:
        with av.open(str(path)) as container:
            opened: Any = container
            klv = [stream for stream in opened.streams if stream.type == "data"]
            video = opened.streams.video[0] if opened.streams.video else None
            if not klv or video is None:
                return [], []
            begin_s = float(video.start_time * video.time_base) if video.start_time is not None else 0.0
            for packet in opened.demux(klv):
                content = bytes(packet)
                size += len(content)
                if size > MOST_BYTES:
                    break
                if packet.pts is None:
                    continue
                at_s = float(packet.pts * packet.time_base) - begin_s
                for state in decode_packets(content):
                    row = row_of(state, max(0.0, at_s))
                    if row is not None:
                        rows.append(row)
                        states.append(state)
    except (OSError, ValueError) as error:  # PyAV's errors are both
        raise InputFileError(f"{path}: {str(error).splitlines()[0][:100]}; accepted: a video") from None
    return sorted(rows, key=lambda row: row.at_s), states
