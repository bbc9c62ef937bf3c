"""Messages about clicked spots between the pipeline, which knows the vehicle's motion, and the camera process, which
has the pictures.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, TypeAlias

import msgspec

CLICK_LABEL: Final = "click"
"""Label of detections of a clicked spot. [detections] labels and min_score do not apply to it."""


QUESTION: Final = b'{"question":'
"""Prefix of the camera process's question for the spots' views in a picture: a frame in the wire format without
detections follows, and a closing brace."""
REFUSAL: Final = b'{"spot":'
"""Prefix of :class:`SpotRefused` as JSON."""


class SpotView(msgspec.Struct, frozen=True, gc=False):
    """Predicted view of a spot in a picture, from the vehicle's motion."""

    at: tuple[float, float]
    """Predicted pixel."""
    pixel_from_ground: tuple[float, float, float, float]
    """d(u, v) / d(north, east) at the spot, row by row, pixels per metre."""
    reach_px: float
    """Radius around the predicted pixel that contains the spot at three sigma, pixels."""


class FollowSpot(msgspec.Struct, frozen=True, tag="follow"):
    """Order: follow a spot, starting in a kept picture."""

    spot: int
    """Number of the spot; its detections carry this number as ``id``."""
    picture: int
    """Number of the picture on which the operator clicked."""
    view: SpotView


class ReleaseSpot(msgspec.Struct, frozen=True, tag="release"):
    """Order: stop following a spot."""

    spot: int


class SpotViews(msgspec.Struct, frozen=True, tag="views"):
    """Answer to an announced picture: the predicted view of each spot in it."""

    picture: int
    views: Mapping[int, SpotView]


SpotMessage: TypeAlias = FollowSpot | ReleaseSpot | SpotViews
"""Every message about spots to the camera process."""


class SpotRefused(msgspec.Struct, frozen=True):
    """A spot that cannot be followed, as the camera process reports it."""

    spot: int
    refused: str
    """Name of the reason."""
