"""The spots that operators clicked, followed through the pictures of one camera. PURE."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from fwav_companion.types.spots import CLICK_LABEL, FollowSpot, SpotView
from fwav_companion.vision.patch.appearance import HALF_PX, Image
from fwav_companion.vision.patch.patch_tracker import NoMatch, PatchTracker
from fwav_companion.vision.patch.pictures import KeptPictures

MOST_SPOTS: Final = 4
"""Most spots that are followed at the same time: the one selected by a station, and former clicks with live tracks."""


class FollowedSpots:
    """All spots that are followed."""

    def __init__(self, pictures: KeptPictures) -> None:
        self._pictures = pictures
        self._trackers: dict[int, PatchTracker] = {}

    def __bool__(self) -> bool:
        return bool(self._trackers)

    def follow(self, order: FollowSpot) -> NoMatch | None:
        """Begin to follow a spot; returns the reason if this is not possible. The oldest spot makes room."""
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
        """Stop following a spot."""
        self._trackers.pop(spot, None)

    def detections(self, picture: Image, views: Mapping[int, SpotView]) -> list[dict[str, Any]]:
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
