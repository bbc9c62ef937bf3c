"""Cameras, sights and results of `locate`. PURE.

World: local NED about an origin, metres; down is counted from the level that the answer is counted from.
"""

from __future__ import annotations

from enum import IntEnum

import msgspec

from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.types import Lens, Pixel


class SharedError(IntEnum):
    """Errors that are the same in all pictures of a group; estimate minus truth."""

    NORTH = 0
    """Camera position, metres."""
    EAST = 1
    HEIGHT = 2
    """Camera position up, metres."""
    MOUNT_X = 3
    """Small rotation about the camera's axes (x right, y down, z forward), radians."""
    MOUNT_Y = 4
    MOUNT_Z = 5
    HEADING = 6
    """Small rotation about down, radians."""
    FOCAL = 7
    """Focal length, relative."""
    DELAY = 8
    """Delay of a video's telemetry against its pictures, seconds."""


SHARED_COUNT = len(SharedError)


class Shot(msgspec.Struct, frozen=True, kw_only=True):
    """One picture as a camera in the world."""

    name: str
    camera_ned: Vector3
    ned_from_camera: Matrix3
    lens: Lens
    own_position_m: float
    """One sigma of this picture's own error of north and of east."""
    own_height_m: float
    own_attitude: float
    """One sigma of this picture's own rotation error about each camera axis, radians."""
    velocity_ned: Vector3 = (0.0, 0.0, 0.0)
    """Of the camera, metres a second; 0 for a photograph, whose pose is of its own instant."""
    turn: Vector3 = (0.0, 0.0, 0.0)
    """Rotation vector about the camera's axes (x right, y down, z forward), radians a second."""
    group: int = 0
    """Index of the group whose shared errors this picture has: pictures of one camera on one flight."""


class Sight(msgspec.Struct, frozen=True):
    """A point of a target in a picture."""

    shot: int
    """Index of the picture."""
    pixel: Pixel
    label: str
    sigma_px: float = 1.0


class Budget(msgspec.Struct, frozen=True):
    """One sigma of the horizontal position by cause, metres: square root of the trace of each cause's covariance."""

    pixel: float
    own_position: float
    own_attitude: float
    shared_position: float
    shared_height: float
    mount: float
    heading: float
    focal: float
    ground: float
    delay: float = 0.0

    def dominant(self) -> tuple[str, float]:
        """The largest cause and its share of the variance."""
        parts = msgspec.structs.asdict(self)
        total = sum(part * part for part in parts.values())
        name = max(parts, key=lambda each: parts[each])
        return name, parts[name] ** 2 / total if total > 0.0 else 0.0


class Residual(msgspec.Struct, frozen=True):
    """Where the target should be in a picture by the answer, and how well the click agrees."""

    shot: int
    pixel: Pixel | None
    """Predicted pixel; None where the lens cannot show it."""
    sigmas: float
    """Distance of the click from it over its expected error."""


class PixelPrediction(msgspec.Struct, frozen=True):
    """Where a target should be in a picture that has no sight of it."""

    shot: int
    pixel: Pixel
    cov: tuple[tuple[float, float], tuple[float, float]]
    """Covariance of the pixel (u, v), by the place's, the shared and this picture's own errors, px^2."""


class Place(msgspec.Struct, frozen=True):
    """The estimate of one target."""

    label: str
    ned: Vector3
    cov: Matrix3
    """Total covariance, NED, m^2."""
    budget: Budget
    residuals: tuple[Residual, ...]
    height_above_target_m: float
    """Of the lowest camera."""
    predictions: tuple[PixelPrediction, ...] = ()
    """In all other pictures that show it; empty where they were not asked for."""


class SharedEstimate(msgspec.Struct, frozen=True):
    """A shared error that the sights show."""

    group: int
    error: SharedError
    value: float
    sigma: float
    prior: float


class SightsEstimate(msgspec.Struct, frozen=True):
    """The places of all targets, and what the sights say about the shared errors."""

    places: tuple[Place, ...]
    shared: tuple[SharedEstimate, ...]
    """Shared errors whose sigma fell below half of the prior's."""
    contradiction: str = ""
    """Which picture disagrees, where the sights contradict the claimed errors; empty otherwise."""
    unverified: str = ""
    """What the sights are too few to show about their errors; empty otherwise."""
    error_scale: float = 1.0
    """Root mean square of the scale of the poses' errors to the assumed ones, by which the claim is."""
