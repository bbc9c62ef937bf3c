"""Landmarks: surveyed things that a camera sees, and what their sights showed."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from fwav_companion.geometry.earth import Geodetic
from fwav_companion.types.sightings import GroundFix


class Landmark(msgspec.Struct, frozen=True):
    """A thing whose place is known."""

    label: str
    """Label of its detections."""
    place: Geodetic
    sigma_m: float
    """One sigma of the survey, metres an axis."""


class LandmarkSight(msgspec.Struct, frozen=True, gc=False):
    """One detection of a landmark, intersected with the level of its known altitude."""

    landmark: int
    """Index of the landmark in the configuration."""
    fix: GroundFix
    north_m: float
    """Known place, NED, metres."""
    east_m: float


class LandmarkState(StrEnum):
    """Use that is made of a landmark."""

    UNSEEN = "unseen"
    """No sight agreed with it yet."""
    USED = "used"
    LEFT_OUT = "left_out"
    """It disagrees with all else by more than its claim."""
    NOT_APPLIED = "not_applied"
    """[tracking] chooses a filter or a motion that landmarks do not correct."""


class LandmarkRecord(msgspec.Struct, frozen=True, gc=False):
    """What the sights of one landmark showed so far."""

    label: str
    state: LandmarkState = LandmarkState.UNSEEN
    used: int = 0
    """Sights that were used."""
    refused: int = 0
    """Sights that disagreed with all else."""
    off_m: float = 0.0
    """Distance between its known place and where sights that disagree show it, metres."""
    contradicts: tuple[str, ...] = ()
    """Labels of the landmarks that it contradicts, where the flight does not show which is wrong."""


class LandmarkAltitude(msgspec.Struct, frozen=True, gc=False):
    """The vehicle's altitude above sea level against that of a landmark."""

    landmark: int
    """Index of the landmark in the configuration."""
    too_high_m: float
    """Reported minus true altitude, metres."""
    sigma_m: float
    """One sigma of it and of the landmark's own altitude, metres."""
