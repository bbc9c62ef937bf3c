"""Landmarks: surveyed objects that a camera sees, and the records of their sights."""

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
    """Whether and how a landmark is used."""

    UNSEEN = "unseen"
    """No sight has agreed with its known place yet."""
    USED = "used"
    LEFT_OUT = "left_out"
    """It disagrees with all other measurements by more than its survey accuracy allows."""
    NOT_APPLIED = "not_applied"
    """[tracking] chooses a filter or a motion that landmarks do not correct."""


class LandmarkRecord(msgspec.Struct, frozen=True, gc=False):
    """Record of the sights of one landmark so far."""

    label: str
    state: LandmarkState = LandmarkState.UNSEEN
    used: int = 0
    """Number of sights that were used."""
    refused: int = 0
    """Number of sights that disagreed with all other measurements."""
    off_m: float = 0.0
    """Distance between its known place and its place by the sights that disagree, metres."""
    contradicts: tuple[str, ...] = ()
    """Labels of the landmarks that it contradicts, where the flight does not show which is wrong."""


class LandmarkAltitude(msgspec.Struct, frozen=True, gc=False):
    """Error of the vehicle's reported altitude above sea level, as a landmark shows it."""

    landmark: int
    """Index of the landmark in the configuration."""
    too_high_m: float
    """Reported minus true altitude, metres."""
    sigma_m: float
    """One sigma of this error, that of the landmark's own altitude included, metres."""
