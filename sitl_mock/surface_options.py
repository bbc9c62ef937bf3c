"""Options of the ground's surface. Metres."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, TypeAlias

from msgspec import Meta

from sitl_mock.option_types import NotNegative, Positive

Count: TypeAlias = Annotated[int, Meta(ge=0, le=10_000)]
Tree: TypeAlias = tuple[float, float, float]
"""(north, east, height): place from the flight centre, metres."""


@dataclass(frozen=True, kw_only=True)
class SurfaceOptions:
    """The surface that a camera sees: level, or hilly with trees and houses in places that the seed draws."""

    trees: Count = 0
    """Number of drawn trees: round, 4 to 9 m high."""
    houses: Count = 0
    """Number of drawn houses: 10 m by 10 m with flat roofs of 6 m."""
    tree_at: tuple[Tree, ...] = ()
    """Further trees in chosen places."""
    relief_m: NotNegative = 0.0
    """Amplitude of the bare ground: hills some 125 m and 170 m from crest to trough along north and east."""
    half_size_m: Positive = 110.0
    """Half side of the square about the flight centre in which trees and houses are drawn."""
    clear_m: NotNegative = 4.0
    """Least distance of a drawn tree's trunk or a house's wall from a target; home keeps four times as much."""
