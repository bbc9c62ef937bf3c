"""Gross mistakes by name: what of the image or of the attitude is turned, mirrored or reversed.

The turns of two frames show the camera's axes against the body's (:mod:`fwav_companion.tools.shake.first_look`). A
turned image changes them by a rotation. A mirrored one does too, since rotations are seen as axial vectors: mirrored
left to right, the camera seems to look the other way. A reversed axis of the attitude alone makes them left-handed.
"""

from __future__ import annotations

from math import radians
from typing import Final

import msgspec
import numpy as np

from fwav_companion.tools.shake.first_look import FirstLook
from fwav_companion.tools.shake.turns import Floats

NEAR: Final = radians(25.0)
"""A mount that is this near to what a name says is meant by it; names lie 90 deg apart."""


class Mistake(msgspec.Struct, frozen=True):
    """What is wrong, in words."""

    name: str
    do: str
    mount_rights_it: bool
    """Another mount in the configuration is all that it takes."""


TURNED = "paste the mount below if the camera really sits so; else turn it, or its picture, back"
MIRRORED = "switch the mirroring off in the camera's settings, or check in which order the corners are told"
SIGNS = (
    "check how the autopilot is configured to be mounted (ArduPilot AHRS_ORIENTATION, PX4 SENS_BOARD_ROT), and "
    "whoever passes its attitude on"
)

_QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
_EXCHANGED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])

OF_IMAGE: Final = (
    (Mistake("image upside down", TURNED, True), np.diag([-1.0, -1.0, 1.0])),
    (Mistake("mount turned by 90 deg", TURNED, True), _QUARTER),
    (Mistake("mount turned by 90 deg", TURNED, True), _QUARTER.T),
    (Mistake("image mirrored left to right", MIRRORED, False), np.diag([1.0, -1.0, -1.0])),
    (Mistake("image mirrored top to bottom", MIRRORED, False), np.diag([-1.0, 1.0, -1.0])),
    (Mistake("image mirrored and turned by 90 deg", MIRRORED, False), -_EXCHANGED),
    (Mistake("image mirrored and turned by 90 deg", MIRRORED, False), -_EXCHANGED @ np.diag([-1.0, -1.0, 1.0])),
)
"""And what each does to turns in camera axes."""
OF_ATTITUDE: Final = (
    (Mistake("roll reversed", SIGNS, False), np.diag([-1.0, 1.0, 1.0])),
    (Mistake("pitch reversed", SIGNS, False), np.diag([1.0, -1.0, 1.0])),
    (Mistake("yaw reversed", SIGNS, False), np.diag([1.0, 1.0, -1.0])),
    (Mistake("roll, pitch and yaw reversed", SIGNS, False), -np.eye(3)),
    (Mistake("roll and pitch exchanged", SIGNS, False), _EXCHANGED),
    (Mistake("roll and pitch exchanged, one of them reversed", SIGNS, False), _QUARTER),
    (Mistake("roll and pitch exchanged, one of them reversed", SIGNS, False), _QUARTER.T),
    (Mistake("roll and pitch reversed", SIGNS, False), np.diag([-1.0, -1.0, 1.0])),
)
"""And what each does to turns in body axes."""

NOT_ROUND: Final = Mistake(
    "corners told in another order",
    "tell the tag's corners round it, not in rows: top left, top right, bottom right, bottom left of the print",
    False,
)
OTHER_HAND: Final = Mistake("an axis of the attitude reversed, or the image mirrored", SIGNS, False)
"""What is left where no name fits."""


def named(look: FirstLook, configured: Floats, *, backward: bool) -> Mistake | None:
    """The mistake that explains the first look; None where the configured mount is near, or no name fits.

    ``configured``: (3, 3) camera_from_body. ``backward``: the corners ran the other way round in the image, which
    decides between a mirrored image and a reversed axis while the third axis was hardly turned about.
    """
    seen = [look.camera_from_body]
    if not look.handed:
        seen.append(look.camera_from_body @ (np.eye(3) - 2.0 * np.outer(look.weakest, look.weakest)))
    if min(_apart(each, configured) for each in seen) <= NEAR:
        return None
    explained = [(mistake, by @ configured) for mistake, by in OF_IMAGE if look.handed or _fits(mistake, backward)]
    explained += [(mistake, configured @ by) for mistake, by in OF_ATTITUDE if look.handed or not backward]
    apart = [(min(_apart(each, there) for each in seen), mistake) for mistake, there in explained]
    nearest, mistake = min(apart, key=lambda each: each[0])
    if nearest <= NEAR:
        return mistake
    return OTHER_HAND if np.linalg.det(look.camera_from_body) < 0.0 else None


def _fits(mistake: Mistake, backward: bool) -> bool:
    return backward or mistake.do is not MIRRORED


def _apart(a: Floats, b: Floats) -> float:
    """The angle between two orthogonal matrices of one handedness; half a circle and more between others."""
    if np.linalg.det(a) * np.linalg.det(b) < 0.0:
        return 2.0 * np.pi
    return float(np.arccos(np.clip(0.5 * (np.trace(a.T @ b) - 1.0), -1.0, 1.0)))
