"""Landing pads: several tags in a fixed layout that are one target, and the point on it to land on."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

import msgspec
from msgspec import Meta

Label: TypeAlias = Annotated[str, Meta(min_length=1, max_length=256)]
Offset: TypeAlias = Annotated[float, Meta(ge=-100, le=100)]
TagSizeM: TypeAlias = Annotated[float, Meta(gt=0, le=100)]
"""Side of a tag's square between its outermost black and the white around it, metres."""


class PadContradiction(msgspec.Struct, frozen=True, gc=False, kw_only=True):
    """A tag that is not where its pad has it, as the pad's other tags show."""

    pad: str
    tag: str
    """Labels."""
    off_m: float
    """Distance of its centre from where the pad has it, metres."""
    corner_off_m: float
    """Largest distance of one of its corners from where the pad has it, metres."""
    pictures: int = 1
    """Number of pictures that have shown it."""


class PadTag(msgspec.Struct, frozen=True, kw_only=True):
    """One tag of a pad, flat on it, face up."""

    label: Label
    """Label of its detections."""
    size_m: TagSizeM
    """Side of its square between the outermost black and the white around it, metres; not that of the sheet."""
    at_m: tuple[Offset, Offset] = (0.0, 0.0)
    """Centre on the pad: forward and right of the pad's origin, metres."""
    yaw_deg: Annotated[float, Meta(ge=-360, le=360)] = 0.0
    """Direction of its upper edge, clockwise from the pad's forward axis, degrees; 0: the top of the print is
    forward."""


class Pad(msgspec.Struct, frozen=True, kw_only=True):
    """One [[pad]]: tags in a fixed layout are one target. What is reported is its landing point."""

    label: Label
    """Label of the pad's track; [publish] landing_label names it."""
    tags: tuple[PadTag, ...]
    """Its tags, each a table of ``label``, ``size_m``, ``at_m`` and ``yaw_deg``."""
    height_m: Annotated[float, Meta(ge=0, le=1000)] = 0.0
    """Height of the pad above the ground, metres."""
    landing_offset_m: tuple[Offset, Offset] = (0.0, 0.0)
    """Landing point: forward and right of the pad's origin along the pad's own axes, metres."""
    motion: Literal["static", "moving"] | None = None
    """Motion of the pad; None: that of all targets, [tracking] motion."""

    @property
    def height_sigma_m(self) -> float:
        """One sigma of the height above the ground, metres: as of a [[target]], a tenth of it."""
        return 0.1 * self.height_m
