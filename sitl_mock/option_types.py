"""Types of option values, with the bounds that a command line may not leave."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from msgspec import Meta

Triple: TypeAlias = tuple[float, float, float]
Waypoint: TypeAlias = tuple[float, float, float, float, float]
"""(at_s, north, east, up, heading_deg): north and east from the flight centre, up from the ground, metres."""
PositionShift: TypeAlias = tuple[float, float, float, float]
"""(from_s, to_s, north, east): the estimator shifts its position by (north, east) metres between the two instants."""
Positive: TypeAlias = Annotated[float, Meta(gt=0.0)]
MOST_HZ = 10_000.0
"""Highest frame rate, above any camera's; without a bound a flight of one second might never end."""
FrameRate: TypeAlias = Annotated[float, Meta(gt=0.0, le=MOST_HZ)]
TruthRate: TypeAlias = Annotated[float, Meta(ge=0.0, le=MOST_HZ)]
NotNegative: TypeAlias = Annotated[float, Meta(ge=0.0)]
Share: TypeAlias = Annotated[float, Meta(ge=0.0, le=1.0)]
Size: TypeAlias = Annotated[int, Meta(ge=1, le=8192)]
