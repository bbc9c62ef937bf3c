"""Contents of images: frames, detections and rays, and the protocol of a lens model."""

from __future__ import annotations

from enum import StrEnum
from typing import Protocol, TypeAlias

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.types.reasons import Reason

Pixel: TypeAlias = tuple[float, float]
"""Pixel coordinates (u, v); (0, 0) is the centre of the top left pixel."""
Corners: TypeAlias = tuple[Pixel, Pixel, Pixel, Pixel]
"""Corners of a marker's black square: top left, top right, bottom right, bottom left of the marker as printed."""

Outline: TypeAlias = tuple[Pixel, ...]
"""Corners of a convex polygon, in order."""


class StampClock(StrEnum):
    """The clock of a frame's stamp."""

    HOST = "host"
    BOOT = "boot"


class Detection(msgspec.Struct, frozen=True, gc=False):
    """One detected object in one frame, in pixels of the calibration."""

    u: float
    """Column, pixels to the right; 0 is the centre of the leftmost column."""
    v: float
    """Row, pixels down; 0 is the centre of the topmost row."""
    sigma: tuple[float, float] | None = None
    """One sigma of u and v, pixels; None: [uncertainty] pixel_noise_px."""
    label: str = ""
    score: float | None = None
    box: tuple[float, float, float, float] | None = None
    """Bounding box: left, top, right, bottom, pixels."""
    detector_id: int | None = None
    """Track id of the detector."""
    corners: Corners | None = None
    """Corners of a marker; None for other objects."""
    outline: Outline | None = None
    """Convex outline of the object, pixels: of a turned box or a mask; None where the box is all."""
    foot: Pixel | None = None
    """Pixel midway between the confident ankles of a person; None without them."""


class Frame(msgspec.Struct, frozen=True):
    """One decoded frame, possibly without detections."""

    number: int | None
    """Frame number of the source; None where it sends none."""
    stamp_ns: int
    """Stamp of the source on :attr:`stamp_clock`, nanoseconds."""
    stamp_clock: StampClock
    arrival_ns: HostNs | None
    """Arrival at this host, whole microseconds; None in a recording without ``received_unix``."""
    detections: tuple[Detection, ...]
    size: tuple[int, int] | None = None
    """Width and height of the image that the detections refer to, pixels; None: those of the calibration."""
    exposure_s: float | None = None
    """Exposure time, seconds; None where the source does not report it."""
    picture: int | None = None
    """Number of the picture that the service's own camera process keeps for clicks; None where it keeps none."""
    file: str = ""
    """Name of the photograph; "" where the source sends none."""


class DeliveryReport(msgspec.Struct, frozen=True, kw_only=True):
    """Size, rate and ages of the pictures that a camera actually delivers, from its newest ones."""

    size: tuple[int, int]
    """Width and height, pixels."""
    fps: float
    """Pictures a second, skipped ones included."""
    exposure_s: float | None = None
    """Exposure of the newest picture, seconds; None where the camera does not report it."""
    clock: str = ""
    """Source of the stamps: sensor, driver, arrival, server, file, or the name of a stamp."""
    age_s: float | None = None
    """Median age of a picture on arrival, seconds; None where its stamp is on another clock."""
    detector_hz: float = 0.0
    """Pictures a second that the detector can process on this board, from its median time."""
    skipped: int = 0
    """Pictures that were skipped because a newer one had come."""
    frozen: bool = False
    """Whether the camera repeats one picture."""


class NoFrame(msgspec.Struct, frozen=True):
    """The reason why a datagram or a line was rejected."""

    reason: Reason
    detail: str = ""


class NoRay(msgspec.Struct, frozen=True):
    """The reason why a pixel has no ray, or a point no pixel."""

    reason: Reason = Reason.OUTSIDE_LENS


class Ray(msgspec.Struct, frozen=True, gc=False):
    """A unit ray in the camera frame with its derivatives with respect to the pixel."""

    direction: Vector3
    d_du: Vector3
    """d(direction)/du, per pixel."""
    d_dv: Vector3
    """d(direction)/dv, per pixel."""


class Lens(Protocol):
    """The intrinsic geometry of a camera; projection and back-projection have the same range of validity."""

    @property
    def image_size(self) -> tuple[int, int]:
        """Width and height of the image, pixels."""

    @property
    def max_angle(self) -> float:
        """The largest valid angle from the optical axis, radians."""

    def camera_ray_from_pixel(self, u: float, v: float) -> Vector3 | NoRay:
        """The unit ray of a pixel in the camera frame (x right, y down, z forward)."""

    def camera_ray_and_derivatives_from_pixel(self, u: float, v: float) -> Ray | NoRay:
        """The unit ray of a pixel with its derivatives."""

    def pixel_from_camera_point(self, point: Vector3) -> tuple[float, float] | NoRay:
        """The pixel (u, v) of a point in the camera frame, of any length; the pixel may lie outside the image."""
