"""Clicked spots: what the pipeline, which knows how the vehicle moves, and the camera process, which has the pictures,
say to one another about them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, TypeAlias

import msgspec

CLICK_LABEL: Final = "click"
"""Label of detections of a clicked spot. [detections] labels and min_score do not apply to it."""


QUESTION: Final = b'{"question":'
"""Prefix of the camera process's question where a picture shows the spots: a frame in the wire format without
detections follows, and a closing brace."""
REFUSAL: Final = b'{"spot":'
"""Prefix of :class:`SpotRefused` as JSON."""


class SpotView(msgspec.Struct, frozen=True, gc=False):
    """Where and how a picture must show a spot, by the vehicle's motion."""

    at: tuple[float, float]
    """Predicted pixel."""
    pixel_from_ground: tuple[float, float, float, float]
    """d(u, v) / d(north, east) at the spot, row by row, pixels per metre."""
    reach_px: float
    """Radius that holds the spot with three sigma, pixels."""


class FollowSpot(msgspec.Struct, frozen=True, tag="follow"):
    """Order: follow a spot from a kept picture on."""

    spot: int
    """Number of the spot; detections of it bring it as ``id``."""
    picture: int
    """Number of the frame that the operator saw."""
    view: SpotView


class ReleaseSpot(msgspec.Struct, frozen=True, tag="release"):
    """Order: follow a spot no more."""

    spot: int


class SpotViews(msgspec.Struct, frozen=True, tag="views"):
    """Answer to a picture that was announced: where each spot must be in it."""

    picture: int
    views: Mapping[int, SpotView]


SpotMessage: TypeAlias = FollowSpot | ReleaseSpot | SpotViews
"""Everything that goes to the camera process."""


class SpotRefused(msgspec.Struct, frozen=True):
    """A spot that cannot be followed, as the camera process reports it."""

    spot: int
    refused: str
    """Name of the reason."""
