"""Detects AprilTags 36h11 and ArUco markers with OpenCV, with an uncertainty that depends on motion blur."""

from __future__ import annotations

from collections.abc import Collection
from math import sqrt
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fwav_companion.vision.detectors.marker_sigma import marker_sigma_px
from fwav_companion.vision.detectors.nested_tags import NestedTags
from fwav_companion.vision.images import Found, Pixels, grey

ARUCO_DICTIONARIES: Final = {
    f"{side}x{side}_{count}": getattr(cv2.aruco, f"DICT_{side}X{side}_{count}")
    for side in (4, 5, 6, 7)
    for count in (50, 100, 250, 1000)
}
APRILTAG_FAMILIES: Final = {
    "16h5": (cv2.aruco.DICT_APRILTAG_16h5, 6),
    "25h9": (cv2.aruco.DICT_APRILTAG_25h9, 7),
    "36h10": (cv2.aruco.DICT_APRILTAG_36h10, 8),
    "36h11": (cv2.aruco.DICT_APRILTAG_36h11, 8),
}
"""Dictionaries of OpenCV, and the number of modules along a side of the black square."""
PROFILES = 5
"""Number of profiles across each side."""


class MarkerDetector:
    """Detector of the markers of one OpenCV dictionary."""

    def __init__(self, dictionary: int, label: str, modules: int, apart: Collection[str] = ()) -> None:
        """``modules``: number along a side of the black square. ``apart``: labels of tags that never stand for another
        one in which they lie.
        """
        detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(dictionary))
        parameters = detector.getDetectorParameters()
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        detector.setDetectorParameters(parameters)
        self._detector = detector
        self._label = label
        self._modules = modules
        self._nested = NestedTags(apart)

    def detect(self, pixels: Pixels) -> list[Found]:
        """The markers, each at the crossing of its diagonals."""
        picture = grey(pixels)
        quads, ids, _ = self._detector.detectMarkers(picture)
        if ids is None:
            return []
        found = (
            self._found(picture, quad.reshape(4, 2), int(number))
            for quad, number in zip(quads, np.ravel(ids), strict=True)
        )
        return self._nested.joined([each for each in found if each is not None])

    def _found(self, picture: Pixels, quad: NDArray[np.float32], number: int) -> Found | None:
        centre = crossing_of_diagonals(quad)
        if centre is None:
            return None
        module_px = max(1.0, sqrt(cv2.contourArea(quad))) / self._modules
        sigma_px = marker_sigma_px(module_px, edge_width(picture, quad, self._modules))
        left, top = quad.min(axis=0)
        right, bottom = quad.max(axis=0)
        return {
            "u": round(centre[0], 3),
            "v": round(centre[1], 3),
            "sigma": round(sigma_px, 3),
            "label": f"{self._label}:{number}",
            "box": [round(float(side), 1) for side in (left, top, right, bottom)],
            "id": number,
            "corners": [[round(float(u), 3), round(float(v), 3)] for u, v in quad],
        }


def apriltags(family: str = "36h11", apart: Collection[str] = ()) -> MarkerDetector:
    """Detector of one of APRILTAG_FAMILIES."""
    dictionary, modules = APRILTAG_FAMILIES[family]
    return MarkerDetector(dictionary, f"tag{family}", modules, apart)


def aruco(dictionary: str, apart: Collection[str] = ()) -> MarkerDetector:
    """Detector of one of ARUCO_DICTIONARIES."""
    return MarkerDetector(ARUCO_DICTIONARIES[dictionary], "aruco", int(dictionary[0]) + 2, apart)


def crossing_of_diagonals(quad: NDArray[np.float32]) -> tuple[float, float] | None:
    """Pixel of the marker's centre: perspective preserves lines, not midpoints. None for a quad without area."""
    a, b, c, d = quad.astype(float)
    first, second, between = c - a, d - b, b - a
    cross = first[0] * second[1] - first[1] * second[0]
    if abs(cross) < 1e-6:
        return None
    share = (between[0] * second[1] - between[1] * second[0]) / cross
    u, v = a + share * first
    return float(u), float(v)


def edge_width(picture: Pixels, quad: NDArray[np.float32], modules: int) -> float:
    """Width in pixels of the outer edge from black to white, on the side that motion blurs most."""
    centre = quad.mean(axis=0)
    widths = []
    for corner, following in zip(quad, np.roll(quad, -1, axis=0), strict=True):
        along = following - corner
        length = float(np.hypot(*along))
        out = np.array([along[1], -along[0]]) / max(length, 1e-6)
        if out @ (corner - centre) < 0.0:
            out = -out
        reach = max(1.0, 0.9 * length / modules)
        offsets = np.arange(-reach, reach + 0.25, 0.5, dtype=np.float32)
        starts = corner + np.linspace(0.25, 0.75, PROFILES, dtype=np.float32)[:, None] * along
        places = starts[:, None, :] + offsets[None, :, None] * out
        # The mean of several profiles per side, so that noise and grass do not sharpen it.
        x, y = places[..., 0].astype(np.float32), places[..., 1].astype(np.float32)
        profile = cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(float).mean(axis=0)
        steps = np.abs(np.diff(profile)) / 0.5
        widths.append(float(np.ptp(profile) / max(float(steps.max()), 1e-6)))
    return max(widths)
