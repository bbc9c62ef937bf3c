"""Standing targets: objects that rise above the ground. A detection marks a part of them at some height."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from fwav_companion.types.pads import TagSizeM

USUAL_SHARE = 0.1
"""One sigma of a height over the height, where the configuration has none. Adults are 1.7 m tall with a sigma of 0.1 m,
and detectors do not distinguish them from children."""


class ElevatedTarget(msgspec.Struct, frozen=True, kw_only=True):
    """One [[target]]: a label whose things rise above the ground. What is reported is their foot, on the ground."""

    label: Annotated[str, Meta(min_length=1, max_length=256)]
    """Label of the detections; unique."""
    height_m: Annotated[float, Meta(ge=0, le=1000)] = 0.0
    """Height above the ground, metres; 0: flat on the ground."""
    height_sigma_m: Annotated[float, Meta(ge=0, le=1000)] | None = None
    """One sigma of the height, the same in every sighting of a thing, metres; None: a tenth of the height."""
    anchor: Literal["center", "bottom", "top", "ankles", "ground"] = "center"
    """Part that a detection marks. ``bottom``: where the image of the vertical through the box's centre leaves the box
    downward in the world. ``ankles``: midway between the confident ankles of a pose model; without them as center."""
    motion: Literal["static", "moving"] | None = None
    """Motion of these targets; None: that of all, [tracking] motion."""
    size_m: TagSizeM | None = None
    """Side of the black square of a tag, metres: its size in the picture then measures the height; None: unknown."""

    @property
    def sigma_m(self) -> float:
        """One sigma of the height, metres."""
        return USUAL_SHARE * self.height_m if self.height_sigma_m is None else self.height_sigma_m
