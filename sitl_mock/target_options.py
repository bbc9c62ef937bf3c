"""Options of a target on the ground, and of the tags of a landing pad."""

from __future__ import annotations

from dataclasses import dataclass

from sitl_mock.option_types import Positive

HEAVE_S = 5.0
"""Period of a small boat in waves."""


@dataclass(frozen=True, kw_only=True)
class PadTagOptions:
    """A tag of a landing pad, about the pad's landing point and in the pad's axes."""

    label: str
    size_m: Positive
    """Side of the black square."""
    forward_m: float = 0.0
    right_m: float = 0.0
    yaw_deg: float = 0.0
    """Direction of the print's top, clockwise from the pad's forward axis."""


@dataclass(frozen=True, kw_only=True)
class TargetOptions:
    """A target on the ground, relative to the flight centre."""

    label: str = "target"
    north: float = 0.0
    east: float = 0.0
    up: float = 0.0
    speed_m_s: float = 0.0
    course_deg: float = 0.0
    heave_m: float = 0.0
    """Amplitude of a deck's rise and fall, period HEAVE_S."""
    leg_m: float = 0.0
    """Length of a walk, then back again; 0: straight on."""
    height_m: float = 0.0
    """Height of a block that stands on the ground; its detections have a box and lie at the box's centre. 0: a
    point."""
    width_m: float = 0.0
    """Side of the block's square base, along north and east."""
    tags: tuple[PadTagOptions, ...] = ()
    """Tags of a pad whose landing point this target is: they are detected, with their corners, in its place."""
    heading_deg: float = 0.0
    """Direction of a pad's forward axis."""
    turn_deg_s: float = 0.0
    """Rate at which a pad turns clockwise."""
