"""Pixels of the tracks in a picture, for the preview: the camera process asks, the daemon answers."""

from __future__ import annotations

from typing import Final

import msgspec

MARKS_QUESTION: Final = b'{"shown":'
"""Prefix of the question: a frame in the wire format without detections follows, and a closing brace."""
MARKS_ANSWER: Final = b'{"type":"marks"'
"""Prefix of :class:`TrackMarks` as JSON."""


class TrackMark(msgspec.Struct, frozen=True, gc=False):
    """Mark of one track in a picture."""

    track: int
    """Number of the track."""
    label: str
    state: str
    """tentative, confirmed or coasting."""
    selected: bool
    """Whether it is the selected target, which ground stations get."""
    at: tuple[float, float]
    """Pixel of its place."""
    cov: tuple[float, float, float]
    """Covariance of that pixel due to the track's place relative to the vehicle, px^2: uu, uv, vv."""


class TrackMarks(msgspec.Struct, frozen=True, tag="marks"):
    """Answer: the tracks in one picture."""

    picture: int
    """Number in the question."""
    marks: tuple[TrackMark, ...]
