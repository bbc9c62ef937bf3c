"""Tracks as the tracker reports them after one frame, and the processed frame that it takes."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from math import inf

import msgspec

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.types.landmarks import LandmarkSight
from fwav_companion.types.reasons import Reason
from fwav_companion.types.sightings import GroundFix, Sighting
from fwav_companion.types.telemetry import VehicleState


class TrackState(StrEnum):
    """Life-cycle state of a track."""

    TENTATIVE = "tentative"
    """Initiated, not yet confirmed."""
    CONFIRMED = "confirmed"
    """Confirmed, and updated recently."""
    COASTING = "coasting"
    """Confirmed, not updated recently: predicted."""
    DROPPED = "dropped"
    """Deleted; reported once, with the reason."""


class Innovation(msgspec.Struct, frozen=True, gc=False):
    """Innovation of a fix: fix minus the target's predicted position."""

    north_m: float
    """North component, metres."""
    east_m: float
    """East component, metres."""
    nis: float
    """Normalised innovation squared (NIS), 2 dof, shared errors included: mean 2 where every covariance is right."""


class FinalPlace(msgspec.Struct, frozen=True):
    """A static target by the sightings of the whole flight."""

    north: float
    """NED, metres."""
    east: float
    cov: tuple[tuple[float, float], tuple[float, float]]
    """Of north and east, by every source of error, m^2."""
    sightings: int
    """Number of sightings that were used."""


class CommonErrors(msgspec.Struct, frozen=True, gc=False):
    """Errors of a target's place that it shares with other targets, by the estimator.

    An error is reported minus true; its column is d(place)/d(error).
    """

    sigmas: tuple[float, ...]
    """One sigma of the vehicle's errors now: position north and east, metres, and heading, radians."""
    north: tuple[float, ...]
    """Derivative of the target's north by these errors, metres a metre and metres a radian."""
    east: tuple[float, ...]
    """The same of its east."""
    height: tuple[float, float]
    """Displacement north and east by one sigma of the height of target and ground, metres."""


class GateResult(msgspec.Struct, frozen=True, gc=False):
    """Gating statistics of a fix against a predicted track."""

    nis: float
    """Normalised innovation squared (NIS), 2 degrees of freedom; inf outside the coarse gate."""
    log_det_ratio: float
    """Log of the determinant ratio of innovation covariance to the fix's own noise, horizontal."""


class GateShare(msgspec.Struct, frozen=True, gc=False):
    """Share of a track, or of a fix, in the innovation's variance along north and east.

    With the shares a and b, the north variance is at most ``a.nn + b.nn + |a.north - b.north|^2``; likewise for east.
    """

    nn: float
    """Variance of the errors that track and fix do not share, north, m^2."""
    ee: float
    """Variance of the errors that track and fix do not share, east, m^2."""
    north: tuple[float, ...]
    """Sensitivity of the north component to shared errors of unit variance, metres."""
    east: tuple[float, ...]
    """Sensitivity of the east component to shared errors of unit variance, metres."""


OUTSIDE_GATE = GateResult(inf, 0.0)
"""The result of a fix outside the coarse gate."""


class Track(msgspec.Struct, frozen=True, gc=False, kw_only=True):
    """One target after one frame; immutable, a new object every frame."""

    id: int
    """Track number, counted from 1, never reused."""
    label: str
    state: TrackState
    reason: Reason | None = None
    """Reason of deletion; None unless DROPPED."""
    replaced_by: int | None = None
    """Id of the senior track of the same target; None unless merged into it (REPLACED)."""
    replaces: tuple[int, ...] = ()
    """Ids of the latest tracks that were merged into this one."""
    host_ns: HostNs
    """Capture of the frame's row 0, host clock."""
    boot_ns: BootNs
    """Capture of the frame's row 0, autopilot clock."""
    frame: int
    """Frame number."""
    position_ned: Vector3
    """Position in local NED, metres."""
    cov: Matrix3
    """Total covariance of the position, NED, m^2."""
    apparent_ned: Vector3
    """Position in the frame of the vehicle's own reports, NED, metres: the position plus the present error of the
    vehicle's position. Minus the reported vehicle position it is the target relative to the vehicle."""
    relative_cov: Matrix3
    """Covariance of the target relative to the vehicle, the covariance of ``apparent_ned``, NED, m^2."""
    vehicle_ned: Vector3 | None = None
    """Vehicle's position at the capture as reported, local NED, metres; None where it is not known."""
    velocity_ned: Vector3 | None = None
    """Velocity in NED, m/s; None for a filter without velocity."""
    velocity_cov: Matrix3 | None = None
    """Covariance of the velocity, NED, (m/s)^2."""
    fix: GroundFix | None = None
    """Fix of this frame; None where the frame brought none."""
    looked_for: bool = False
    """Whether this frame covers the target, although it brought no fix of it: a missed detection."""
    innovation: Innovation | None = None
    """Innovation of that fix; None for the first fix, and where innovations are not requested."""
    first_host_ns: HostNs
    """Capture of the first frame with a fix, host clock."""
    confirmed_host_ns: HostNs | None = None
    """Capture of the frame that confirmed the track, host clock."""
    last_seen_host_ns: HostNs
    """Capture of the last frame with a fix, host clock."""
    last_pixel: tuple[float, float] | None = None
    """Pixel (u, v) of the last fix."""


class FrameView(msgspec.Struct, frozen=True):
    """One processed frame: the input of the tracker."""

    frame: int
    host_ns: HostNs
    """Capture of row 0, host clock."""
    boot_ns: BootNs
    """Capture of row 0, autopilot clock."""
    fixes: tuple[GroundFix, ...]
    could_see: Callable[[Vector3], bool]
    """Whether a target at this position, NED, would lie inside the image and the valid range of the lens."""
    vehicle_ned: Vector3 | None = None
    """Vehicle's position at the capture as reported, local NED, metres; None where it is not known."""
    vehicle: VehicleState | None = None
    """The vehicle at the capture as reported; None where it is not known."""
    unplaced: tuple[Sighting, ...] = ()
    """Sightings without a fix, such as too shallow ones."""
    image_px2: float = 640.0 * 480.0
    """Area of the image, square pixels of the calibration."""
    placed_sigma_m: float = 0.0
    """One sigma of the place of NED's zero where it has got one on the earth since the last frame, metres an axis; 0
    without that."""
    jumped_m: float = 0.0
    """Jump of the vehicle's reported position since the previous frame, metres; 0 without a jump."""
    landmarks: tuple[LandmarkSight, ...] = ()
    """Sights of landmarks."""
