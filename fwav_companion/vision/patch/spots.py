"""The spots that operators clicked, followed through the pictures of one camera, and the messages about them. PURE.

The daemon knows how the vehicle moves, this process has the pictures: for each picture the daemon sends where each spot
must be, and gets back detections with the label ``click`` and the spot's number as ``id``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import msgspec

from fwav_companion.vision.patch.appearance import HALF_PX, Image
from fwav_companion.vision.patch.patch_tracker import NoMatch, PatchTracker, PatchView
from fwav_companion.vision.patch.pictures import KeptPictures

CLICK_LABEL: Final = "click"
"""Label of detections of a clicked spot; the configuration's labels and least score do not apply to it."""
MOST_SPOTS: Final = 4
"""Followed at once: one is what a station selects, the others are former clicks whose tracks live."""


class SpotOrder(msgspec.Struct, frozen=True, tag="follow"):
    """Order to follow a spot from a kept picture on."""

    spot: int
    picture: int
    """Number of the picture that the operator saw."""
    view: PatchView


class SpotRelease(msgspec.Struct, frozen=True, tag="release"):
    """Order to follow a spot no more."""

    spot: int


class SpotViews(msgspec.Struct, frozen=True, tag="views"):
    """Where and how each spot must appear in one picture."""

    picture: int
    views: Mapping[int, PatchView]


class FollowedSpots:
    """All spots that are followed."""

    def __init__(self, pictures: KeptPictures) -> None:
        self._pictures = pictures
        self._trackers: dict[int, PatchTracker] = {}

    def __bool__(self) -> bool:
        return bool(self._trackers)

    def follow(self, order: SpotOrder) -> NoMatch | None:
        """Begin to follow a spot; the reason where it cannot be followed. The oldest one makes room."""
        picture = self._pictures.find(order.picture)
        if picture is None:
            return NoMatch.FORGOTTEN
        tracker = PatchTracker.initiate(picture, order.view)
        if isinstance(tracker, NoMatch):
            return tracker
        self._trackers[order.spot] = tracker
        if len(self._trackers) > MOST_SPOTS:
            del self._trackers[next(iter(self._trackers))]
        return None

    def release(self, spot: int) -> None:
        """Follow a spot no more."""
        self._trackers.pop(spot, None)

    def detections(self, picture: Image, views: Mapping[int, PatchView]) -> list[dict[str, Any]]:
        """Detections in the wire format of the spots that are found in this picture."""
        found = []
        for spot, tracker in self._trackers.items():
            match = tracker.update(picture, views[spot]) if spot in views else NoMatch.OUTSIDE
            if not isinstance(match, NoMatch):
                (u, v), half = match.at, float(HALF_PX)
                found.append(
                    {
                        "u": u,
                        "v": v,
                        "sigma": match.sigma_px,
                        "label": CLICK_LABEL,
                        "score": match.correlation,
                        "box": [u - half, v - half, u + half, v + half],
                        "id": spot,
                    }
                )
        return found
