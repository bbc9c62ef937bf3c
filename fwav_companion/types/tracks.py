"""A target as the tracker sees it after one frame."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from math import inf

import msgspec

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.types.reasons import Reason
from fwav_companion.types.sightings import GroundFix, Sighting


class TrackState(StrEnum):
    """The life of a track."""

    TENTATIVE = "tentative"
    """Seen, not often enough to be believed."""
    CONFIRMED = "confirmed"
    """Believed, and seen lately."""
    COASTING = "coasting"
    """Believed, not seen now: predicted."""
    DROPPED = "dropped"
    """Over; told once, with its reason."""


class Innovation(msgspec.Struct, frozen=True, gc=False):
    """A fix against where its target was believed just before."""

    north_m: float
    east_m: float
    distance2: float
    """Normalised square, with all that the two share and do not share: 2 on the mean where every claim is right."""


class Surprise(msgspec.Struct, frozen=True, gc=False):
    """Gating statistics of a fix against a predicted track."""

    distance2: float
    """Normalised innovation squared (NIS), 2 degrees of freedom; inf outside the coarse gate."""
    spread: float
    """Log of the determinant ratio of innovation covariance to the fix's own noise, horizontal."""


OUT_OF_SIGHT = Surprise(inf, 0.0)
"""The result of a fix outside the coarse gate."""


class Track(msgspec.Struct, frozen=True, kw_only=True):
    """One target after one frame. A new object every frame; nobody else changes it."""

    id: int
    """Counted from 1, never reused."""
    label: str
    state: TrackState
    reason: Reason | None = None
    """Of DROPPED."""
    replaced_by: int | None = None
    """The track that is the same target; of one that ended as REPLACED."""
    replaces: tuple[int, ...] = ()
    """Ended tracks that turned out to be this one: the last few, as long as it lives."""
    host_ns: HostNs
    """Capture of the frame's row 0."""
    boot_ns: BootNs
    """The same on the autopilot's clock."""
    frame: int
    position_ned: Vector3
    cov: Matrix3
    """Every source of error, m^2, NED."""
    relative_cov: Matrix3
    """Without the vehicle's own position."""
    velocity_ned: Vector3 | None = None
    velocity_cov: Matrix3 | None = None
    fix: GroundFix | None = None
    """Of this frame alone."""
    innovation: Innovation | None = None
    """Of that fix; None for a first one, and where nobody asked for it."""
    first_host_ns: HostNs
    """Capture of the first frame that saw it."""
    confirmed_host_ns: HostNs | None = None
    last_seen_host_ns: HostNs
    last_pixel: tuple[float, float] | None = None
    """Where it was last seen in the image."""


class FrameView(msgspec.Struct, frozen=True):
    """One processed frame, as the tracker takes it."""

    frame: int
    host_ns: HostNs
    """Capture of row 0."""
    boot_ns: BootNs
    fixes: tuple[GroundFix, ...]
    could_see: Callable[[Vector3], bool]
    """Whether a target at this place, NED, would have been inside the image and the lens's range."""
    unplaced: tuple[Sighting, ...] = ()
    """What was seen and is no fix: too shallow, say."""
