"""Small videos with tracks of telemetry, muxed by PyAV."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

WIDTH, HEIGHT, RATE = 160, 96, 10
ASS_HEADER = (
    b"[Script Info]\r\nScriptType: v4.00+\r\n\r\n[V4+ Styles]\r\nFormat: Name, Fontname, Fontsize, PrimaryColour, "
    b"SecondaryColour, OutlineColour, BackColour, Bold, Italic, Underline, StrikeOut, ScaleX, ScaleY, Spacing, Angle, "
    b"BorderStyle, Outline, Shadow, Alignment, MarginL, MarginR, MarginV, Encoding\r\nStyle: Default,Arial,16,&Hffffff,"
    b"&Hffffff,&H0,&H0,0,0,0,0,100,100,0,0,1,1,0,2,10,10,10,0\r\n\r\n[Events]\r\nFormat: Layer, Start, End, Style, "
    b"Name, MarginL, MarginR, MarginV, Effect, Text\r\n"
)


def write_mp4(path: Path, samples: Sequence[bytes], *, as_mett: bool = False, seconds: int = 3) -> Path:
    """An MP4 with one sample a second, as timed text, or as timed metadata of the type `mett`."""
    av = pytest.importorskip("av")
    with av.open(str(path), "w", format="mp4") as out:
        video = out.add_stream("mpeg4", rate=RATE)
        video.width, video.height, video.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        text = out.add_stream("mov_text")
        text.codec_context.subtitle_header = ASS_HEADER
        for number in range(RATE * seconds):
            frame = av.VideoFrame.from_ndarray(np.full((HEIGHT, WIDTH, 3), number % 256, np.uint8), format="rgb24")
            frame.pts = number
            for coded in video.encode(frame):
                out.mux(coded)
        for coded in video.encode():
            out.mux(coded)
        for number, sample in enumerate(samples):
            coded = av.Packet(sample)
            coded.stream, coded.time_base, coded.duration = text, Fraction(1, 1000), 1000
            coded.pts = coded.dts = 1000 * number
            out.mux(coded)
    if as_mett:
        path.write_bytes(path.read_bytes().replace(b"tx3g", b"mett").replace(b"sbtl", b"meta"))
    return path


def timed_text(text: str) -> bytes:
    """A sample of MPEG-4 timed text."""
    return struct.pack(">H", len(text.encode())) + text.encode()


def parrot_v3(lat: float, lon: float, alt: float, view: Sequence[float], hfov_deg: float) -> bytes:
    """A record P3 by Parrot's table of offsets; ``view``: quaternion w, x, y, z."""
    record = bytearray(72)
    record[:4] = b"P3" + struct.pack(">H", 17)  # words after the name and the length
    struct.pack_into(">iii", record, 8, round(lat * 2**22), round(lon * 2**22), round(alt * 256) << 8 | 14)
    struct.pack_into(">hhhh", record, 44, *(round(each * 2**14) for each in view))
    struct.pack_into(">H", record, 60, round(hfov_deg * 256))
    return bytes(record)
