"""The frames of a video that are worth a look: they follow each other closely, and a moving hand blurs most."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from fwav_companion.tools.calibrate.boards.finder import Grey

PIECES: Final = 60
"""Of each the sharpest frame: in a minute's video one a second."""


def frame_count(video: Path) -> int:
    """As the file says, or at least one; some say it wrongly."""
    capture = cv2.VideoCapture(str(video))
    said = capture.get(cv2.CAP_PROP_FRAME_COUNT)
    capture.release()
    return int(said) if 1.0 <= said < 1e9 else 1


def sharpest(video: Path, count: int, on_frame: Callable[[], None]) -> tuple[list[tuple[int, Grey]], int]:
    """(number, frame) with the crispest edges, of each of PIECES pieces of ``count`` frames; how many frames came."""
    best: dict[int, tuple[float, int, Grey]] = {}
    frames = 0
    for number, grey in enumerate(_frames(video)):
        piece = min(number * PIECES // count, PIECES - 1)
        crisp = float(cv2.Laplacian(grey, cv2.CV_64F).var())
        if piece not in best or crisp > best[piece][0]:
            best[piece] = (crisp, number, grey)
        frames = number + 1
        on_frame()
    return [(number, grey) for _, number, grey in best.values()], frames


def _frames(video: Path) -> Iterator[Grey]:
    capture = cv2.VideoCapture(str(video))
    capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0.0)
    try:
        while True:
            ok, pixels = capture.read()
            if not ok:
                return
            yield np.asarray(pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    finally:
        capture.release()
