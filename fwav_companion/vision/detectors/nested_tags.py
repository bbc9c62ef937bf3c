"""Two nested tags of different sizes are one target, as on landing pads.

From afar only the outer tag is legible; from near its edges leave the image, and only the inner tag is legible. In
between, OpenCV finds sometimes one and sometimes the other: it decodes only one of two nested quads. So an inner tag at
the recent place of the outer tag is reported under the outer tag's label, and after a few such pictures at any place.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Collection
from math import hypot

from fwav_companion.vision.images import Found

MOST_OFFSET = 0.25
"""Largest distance of the two centres as a share of the outer tag's side, including the motion between two pictures.
Tags that lie side by side are farther apart than half of that side."""
MOST_SIZE = 0.5
"""Largest side of the inner tag as a share of the outer tag's: a larger one would cover its code."""
RECENT = 5
"""Number of recent pictures that may show the outer tag: a sixth of a second at 30 frames/s."""
SIGHTINGS = 2
"""Number of pictures after which the two tags are known to be one target."""
MOST_PAIRS = 64
"""Most pairs that are remembered: more than the pads on a field."""


class NestedTags:
    """The inner tags that were recognised, with the labels of their outer ones."""

    def __init__(self, own_labels: Collection[str] = ()) -> None:
        """``own_labels``: labels of tags that are always reported under their own: a [[pad]] knows their places."""
        self._own_labels = frozenset(own_labels)
        self._seen: Counter[tuple[str, str]] = Counter()
        self._outer: dict[str, Found] = {}
        """Label and id of the outer tag by the inner tag's label."""
        self._recent: deque[list[Found]] = deque(maxlen=RECENT)

    def joined(self, found: list[Found]) -> list[Found]:
        """The detections of a picture with each pad once."""
        self._recent.append([each for each in found if each["label"] not in self._outer])
        outer_of = {each["label"]: self._outer_of(each) for each in found}
        seen = {each["label"] for each in found if outer_of[each["label"]] is None}
        joined = []
        for each in found:
            outer = outer_of[each["label"]]
            if outer is None:
                joined.append(each)
            elif outer["label"] not in seen:
                joined.append({**each, **outer})
        return joined

    def _outer_of(self, small: Found) -> Found | None:
        """Label and id of the outer tag in which a tag lies; None for one that lies alone."""
        label = small["label"]
        if label in self._own_labels:
            return None
        if label not in self._outer:
            for large in (each for picture in reversed(self._recent) for each in picture):
                if _is_inside(small, large):
                    names = {"label": large["label"], "id": large["id"]}
                    self._remember(label, names)
                    return names
        return self._outer.get(label)

    def _remember(self, label: str, outer: Found) -> None:
        pair = (label, outer["label"])
        if len(self._seen) < MOST_PAIRS or pair in self._seen:
            self._seen[pair] += 1
        if self._seen[pair] >= SIGHTINGS:
            self._outer[label] = outer


def _is_inside(small: Found, large: Found) -> bool:
    """Whether a tag lies in the middle of another tag's present or recent place."""
    side = _side(large)
    offset = hypot(small["u"] - large["u"], small["v"] - large["v"])
    other = small["label"] != large["label"]
    return other and 0.0 < _side(small) <= MOST_SIZE * side and offset <= MOST_OFFSET * side


def _side(found: Found) -> float:
    """The side of a tag, pixels: the root of its area, by the shoelace formula."""
    corners = found["corners"]
    twice = sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(corners, [*corners[1:], corners[0]], strict=True))
    return float(abs(0.5 * twice) ** 0.5)
