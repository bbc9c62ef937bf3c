"""Images' contents: frames, detections, rays; and what a lens model must answer."""

from __future__ import annotations

from enum import StrEnum
from typing import Protocol, TypeAlias

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.types.reasons import Reason

Pixel: TypeAlias = tuple[float, float]
"""(u, v); (0, 0) is the centre of the top left pixel."""
Corners: TypeAlias = tuple[Pixel, Pixel, Pixel, Pixel]
"""Of a marker's black square: top left, top right, bottom right, bottom left of its own picture, as it was printed."""


class StampClock(StrEnum):
    """The clock of a frame's stamp."""

    HOST = "host"
    BOOT = "boot"


class Detection(msgspec.Struct, frozen=True, gc=False):
    """One thing seen in one frame, in the pixels of the calibration."""

    u: float
    """Pixels, right; 0 is the centre of the leftmost column."""
    v: float
    """Pixels, down; 0 is the centre of the topmost row."""
    sigma: tuple[float, float] | None = None
    """One sigma of u and v, pixels; None: [uncertainty] pixel_noise_px."""
    label: str = ""
    score: float | None = None
    box: tuple[float, float, float, float] | None = None
    """Left, top, right, bottom, pixels."""
    detector_id: int | None = None
    """The detector's own track id."""
    corners: Corners | None = None
    """Of a marker; None for everything else."""


class Frame(msgspec.Struct, frozen=True):
    """One image that was looked at, with what was seen in it, which may be nothing."""

    number: int | None
    stamp_ns: int
    """What the source stamped, on :attr:`stamp_clock`, nanoseconds."""
    stamp_clock: StampClock
    arrival_ns: HostNs | None
    """When it reached this host, whole microseconds; None in a recording that does not tell."""
    detections: tuple[Detection, ...]
    size: tuple[int, int] | None = None
    """Width, height in pixels of the image the detections are told in; None: the calibration's."""
    exposure_s: float | None = None


class NoFrame(msgspec.Struct, frozen=True):
    """A datagram or a line that is no usable frame."""

    reason: Reason
    detail: str = ""


class NoRay(msgspec.Struct, frozen=True):
    """The lens does not see there."""

    reason: Reason = Reason.OUTSIDE_LENS


class Ray(msgspec.Struct, frozen=True, gc=False):
    """A unit ray in the camera frame with its derivatives by the pixel."""

    direction: Vector3
    d_du: Vector3
    """Per pixel."""
    d_dv: Vector3
    """Per pixel."""


class Projection(msgspec.Struct, frozen=True, gc=False):
    """Where a point of the camera frame appears, with the derivatives of its pixel by the point."""

    u: float
    v: float
    du: Vector3
    """d(u)/d(point), pixels per unit of the point's length."""
    dv: Vector3


class Lens(Protocol):
    """A camera's inner geometry. Both directions agree about where it is valid."""

    @property
    def image_size(self) -> tuple[int, int]:
        """Width, height in pixels."""

    @property
    def max_angle(self) -> float:
        """The largest valid angle from the optical axis, radians."""

    def camera_ray_from_pixel(self, u: float, v: float) -> Vector3 | NoRay:
        """The unit ray in the camera frame (x right, y down, z forward)."""

    def camera_ray_and_derivatives_from_pixel(self, u: float, v: float) -> Ray | NoRay:
        """The same with its derivatives."""

    def pixel_from_camera_point(self, point: Vector3) -> tuple[float, float] | NoRay:
        """(u, v) of a point of any length in the camera frame; it may lie outside the image."""

    def projection_from_camera_point(self, point: Vector3) -> Projection | NoRay:
        """The same with its derivatives."""
