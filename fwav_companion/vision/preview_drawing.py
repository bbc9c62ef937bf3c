"""A picture of the preview: detections in green, tracks with their 95 % ellipse. PURE."""

from __future__ import annotations

from collections.abc import Iterable
from math import atan2, degrees, hypot, log, sqrt
from typing import Final

import cv2
import numpy as np

from fwav_companion.types.track_marks import TrackMark
from fwav_companion.vision.images import Found, Pixels

QUALITY: Final = 70
GREEN: Final = (64, 255, 64)
YELLOW: Final = (64, 255, 255)
"""Colour of outlines and feet."""
MAGENTA, ORANGE = (255, 64, 255), (0, 160, 255)
"""Colours of the tracks that were seen recently, and of coasting tracks."""
AXES_95: Final = sqrt(-2.0 * log(0.05))
"""Semi-axes of the 95 % ellipse over one sigma: chi-square with two degrees of freedom."""
MOST_AXIS_PX: Final = 4000.0
"""Longest axis of a drawn ellipse: OpenCV draws with 16-bit numbers, and larger ellipses surround every picture."""
FRACTION_BITS: Final = 4
FONT, TEXT_SIZE = cv2.FONT_HERSHEY_SIMPLEX, 0.4


def drawn(pixels: Pixels, found: Iterable[Found], marks: Iterable[TrackMark] = ()) -> bytes:
    """The picture as JPEG, with boxes, points and labels of the detections, and the tracks."""
    shown = cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR) if pixels.ndim == 2 else pixels.copy()
    for each in found:
        _draw_detection(shown, each)
    for mark in marks:
        _draw_track(shown, mark)
    return bytes(cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1])


def _draw_detection(shown: Pixels, found: Found) -> None:
    place = (round(found["u"]), round(found["v"]))
    cv2.drawMarker(shown, place, GREEN, cv2.MARKER_CROSS, 9, 1)
    if "box" in found:
        left, top, right, bottom = (round(side) for side in found["box"])
        cv2.rectangle(shown, (left, top), (right, bottom), GREEN, 1)
    if "outline" in found:
        cv2.polylines(shown, [np.round(found["outline"]).astype(np.int32)], isClosed=True, color=YELLOW)
    if "foot" in found:
        foot = (round(found["foot"][0]), round(found["foot"][1]))
        cv2.drawMarker(shown, foot, YELLOW, cv2.MARKER_TRIANGLE_UP, 9, 2)
    label = str(found.get("label", ""))
    text = f"{label} {found['score']:.2f}" if "score" in found else label
    cv2.putText(shown, text, (place[0] + 6, place[1] - 6), FONT, TEXT_SIZE, GREEN, 1)


def _draw_track(shown: Pixels, mark: TrackMark) -> None:
    """The ellipse that holds the track's place with 95 %, its number and label; the selected track in bold."""
    colour = ORANGE if mark.state == "coasting" else MAGENTA
    width = 2 if mark.selected else 1
    cv2.drawMarker(shown, (round(mark.at[0]), round(mark.at[1])), colour, cv2.MARKER_TILTED_CROSS, 9, width)
    longer, shorter, angle = ellipse_axes(mark.cov)
    scale = 1 << FRACTION_BITS
    centre = (round(scale * mark.at[0]), round(scale * mark.at[1]))
    axes = tuple(round(scale * min(AXES_95 * axis, MOST_AXIS_PX)) for axis in (longer, shorter))
    cv2.ellipse(shown, centre, axes, degrees(angle), 0.0, 360.0, colour, width, cv2.LINE_AA, FRACTION_BITS)
    text = f"#{mark.track} {mark.label}{' (selected)' if mark.selected else ''}"
    cv2.putText(shown, text, (round(mark.at[0]) + 6, round(mark.at[1]) + 14), FONT, TEXT_SIZE, colour, 1)


def ellipse_axes(cov: tuple[float, float, float]) -> tuple[float, float, float]:
    """(one sigma along the longer axis, along the shorter one, direction of the longer from u toward v, radians)."""
    uu, uv, vv = cov
    middle, half = 0.5 * (uu + vv), hypot(0.5 * (uu - vv), uv)
    return sqrt(max(0.0, middle + half)), sqrt(max(0.0, middle - half)), 0.5 * atan2(2.0 * uv, uu - vv)
