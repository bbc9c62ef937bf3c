"""Names of setup errors: an image or attitude that is turned, mirrored or reversed.

The coarse alignment maps the body's turns to the camera's. A turned image changes this map by a rotation. A mirrored
image does as well, because turns are axial vectors: mirrored left to right, the camera seems to look the other way. A
single reversed axis of the attitude makes the map left-handed.
"""

from __future__ import annotations

from math import radians
from typing import Final

import msgspec
import numpy as np

from fwav_companion.tools.shake.correlation import CoarseAlignment
from fwav_companion.tools.shake.observations import Floats

NEAR: Final = radians(25.0)
"""Largest angle between a map and the one that a named error predicts; those are 90 deg apart."""

TURNED: Final = "if the camera is mounted so, paste the mount below; otherwise turn the camera, or its image, back"
MIRRORED: Final = (
    "switch mirroring off in the camera's settings, or check the order in which the detector sends the corners"
)
SIGNS: Final = (
    "check the autopilot's board orientation (ArduPilot AHRS_ORIENTATION, PX4 SENS_BOARD_ROT), and every program "
    "that forwards its attitude"
)
RATES: Final = "the autopilot's rates contradict its own attitude: check every program that forwards them for a sign"


class SignError(msgspec.Struct, frozen=True):
    """One setup error and what to do about it."""

    name: str
    fix: str
    fixed_by_mount: bool
    """Whether another mount in the configuration corrects the error."""


_QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
_EXCHANGED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])

OF_IMAGE: Final = (
    (SignError("image upside down", TURNED, True), np.diag([-1.0, -1.0, 1.0])),
    (SignError("mount turned by 90 deg", TURNED, True), _QUARTER),
    (SignError("mount turned by 90 deg", TURNED, True), _QUARTER.T),
    (SignError("image mirrored left to right", MIRRORED, False), np.diag([1.0, -1.0, -1.0])),
    (SignError("image mirrored top to bottom", MIRRORED, False), np.diag([-1.0, 1.0, -1.0])),
    (SignError("image mirrored and turned by 90 deg", MIRRORED, False), -_EXCHANGED),
    (SignError("image mirrored and turned by 90 deg", MIRRORED, False), -_EXCHANGED @ np.diag([-1.0, -1.0, 1.0])),
)
"""Errors of the image, and the map of each on turns in camera axes."""
OF_ATTITUDE: Final = (
    (SignError("roll reversed", SIGNS, False), np.diag([-1.0, 1.0, 1.0])),
    (SignError("pitch reversed", SIGNS, False), np.diag([1.0, -1.0, 1.0])),
    (SignError("yaw reversed", SIGNS, False), np.diag([1.0, 1.0, -1.0])),
    (SignError("roll, pitch and yaw reversed", SIGNS, False), -np.eye(3)),
    (SignError("roll and pitch exchanged", SIGNS, False), _EXCHANGED),
    (SignError("roll and pitch exchanged, one of them reversed", SIGNS, False), _QUARTER),
    (SignError("roll and pitch exchanged, one of them reversed", SIGNS, False), _QUARTER.T),
    (SignError("roll and pitch reversed", SIGNS, False), np.diag([-1.0, -1.0, 1.0])),
)
"""Errors of the attitude, and the map of each on turns in body axes."""

CORNER_ORDER: Final = SignError(
    "corners sent in another order",
    "send the tag's corners round the tag, not in rows: top left, top right, bottom right, bottom left of the print",
    False,
)
UNNAMED: Final = SignError("an axis of the attitude reversed, or the image mirrored", SIGNS, False)
"""Error reported for a left-handed map that no single error explains."""


def sign_error_of(alignment: CoarseAlignment, configured: Floats, *, backward: bool) -> SignError | None:
    """The error that explains the alignment; None where the configured mount is near, or where no error fits.

    ``configured``: (3, 3) camera_from_body. ``backward``: whether the corners ran counterclockwise in the image. That
    decides between a mirrored image and a reversed axis where the third axis hardly turned.
    """
    seen = [alignment.camera_from_body]
    if not alignment.handed:
        mirror = np.eye(3) - 2.0 * np.outer(alignment.weakest, alignment.weakest)
        seen.append(alignment.camera_from_body @ mirror)
    if min(_angle_between(each, configured) for each in seen) <= NEAR:
        return None
    candidates = [
        (error, map_ @ configured)
        for error, map_ in OF_IMAGE
        if alignment.handed or backward or error.fix is not MIRRORED
    ]
    candidates += [(error, configured @ map_) for error, map_ in OF_ATTITUDE if alignment.handed or not backward]
    nearest, error = min(
        ((min(_angle_between(each, predicted) for each in seen), error) for error, predicted in candidates),
        key=lambda pair: pair[0],
    )
    if nearest <= NEAR:
        return error
    return UNNAMED if np.linalg.det(alignment.camera_from_body) < 0.0 else None


def _angle_between(a: Floats, b: Floats) -> float:
    """The angle between two orthogonal matrices of one handedness; 2 pi between matrices of different ones."""
    if np.linalg.det(a) * np.linalg.det(b) < 0.0:
        return 2.0 * np.pi
    return float(np.arccos(np.clip(0.5 * (np.trace(a.T @ b) - 1.0), -1.0, 1.0)))
