"""SHELL: pictures to cameras: pose, lens and size of each file, with what was assumed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import radians, tan
from pathlib import Path

import msgspec

from fwav_companion.camera import BrownConrady, Calibration
from fwav_companion.errors import InputFileError
from fwav_companion.photographs.exif_tags import orientation
from fwav_companion.photographs.files import read_tags, with_stated_size
from fwav_companion.photographs.lens_from_tags import lens_from_field_of_view, lens_from_tags
from fwav_companion.photographs.picture_pose import NoLens, NoPose, PictureLens, PicturePose, with_angles, with_mount
from fwav_companion.photographs.pose_from_tags import pose_from_tags
from fwav_companion.photographs.table_poses import with_pose_of_table
from fwav_companion.photographs.tags import PictureTags
from fwav_companion.types import Lens, Pixel

SAME_SHAPE = 0.01
"""Largest relative difference of the aspect ratios of a resized picture and of its original."""
FIRST_SIDEWAYS = 5
"""EXIF orientations from this one on exchange width and height."""
GIVEN_FIELD_SIGMA = 0.02
"""One sigma of a focal length by --hfov."""


class CameraOptions(msgspec.Struct, frozen=True, kw_only=True):
    """What the user says about the camera."""

    calibration: Calibration | None = None
    hfov_deg: float | None = None
    angles_deg: tuple[float, float, float] | None = None
    """Roll, pitch and yaw of the camera, for pictures without; [camera.mount]'s rule."""
    mount_deg: tuple[float, float, float] | None = None
    """Roll, pitch and yaw of [camera.mount], for pictures whose EXIF has a direction alone."""
    table: Mapping[str, PicturePose | NoPose] | None = None
    """Poses by the pictures' names, in place of those of the tags."""
    lenses: Mapping[str, PictureLens] = {}
    """Lenses by the pictures' names, in place of those of the tags."""


class Photograph(msgspec.Struct, frozen=True, kw_only=True):
    """One picture with its pose and lens."""

    path: Path
    size: tuple[int, int]
    """Width and height of the stored image."""
    orientation: int
    """EXIF's orientation, 1 to 8."""
    pose: PicturePose
    lens: Lens
    focal_sigma: float
    notes: tuple[str, ...]

    @property
    def viewed_size(self) -> tuple[int, int]:
        """Width and height of the image as viewers turn it."""
        return (self.size[1], self.size[0]) if self.orientation >= 5 else self.size

    def stored_pixel(self, viewed: Pixel) -> Pixel:
        """The pixel of the stored image for a pixel of the image as viewers turn it."""
        return _stored(viewed, self.size, self.orientation)

    def viewed_pixel(self, stored: Pixel) -> Pixel:
        """The pixel as viewers turn the image, for one of the stored image."""
        inverse = {6: 8, 8: 6}.get(self.orientation, self.orientation)
        return _stored(stored, self.viewed_size, inverse)


def read_photographs(
    paths: Sequence[Path], options: CameraOptions, *, as_stated: bool = False, step: Callable[[], object] = int
) -> list[Photograph]:
    """The pictures in their order. InputFileError names the first without pose or lens, and what to give.

    ``as_stated``: the pictures stand for larger ones, whose size is in EXIF (a hook for tests). ``step`` is called
    after each.
    """
    photographs = []
    for path in paths:
        photographs.append(_read(path, options, as_stated))
        step()
    return photographs


def _read(path: Path, options: CameraOptions, as_stated: bool) -> Photograph:
    tags = read_tags(path)
    tags = with_stated_size(tags) if as_stated else tags
    found = pose_from_tags(tags)
    if options.table is not None:
        found = with_pose_of_table(found, path.name, options.table)
    pose = _pose(path, found, options)
    lens, focal_sigma, notes = _lens(path, tags, options)
    turned = orientation(tags)
    if turned != 1:
        width, height = tags.size if turned < FIRST_SIDEWAYS else tags.size[::-1]
        said = f"EXIF orientation {turned}: pixels count as viewers turn the picture ({width} x {height})"
        notes = (*notes, f"{said}, not as it is stored ({tags.size[0]} x {tags.size[1]})")
    return Photograph(
        path=path,
        size=tags.size,
        orientation=turned,
        pose=pose,
        lens=lens,
        focal_sigma=focal_sigma,
        notes=(*pose.notes, *notes),
    )


def _pose(path: Path, found: PicturePose | NoPose, options: CameraOptions) -> PicturePose:
    found = with_mount(with_angles(found, options.angles_deg), options.mount_deg)
    if isinstance(found, NoPose):
        raise InputFileError(f"{path}: {found.reason}")
    return found


def _lens(path: Path, tags: PictureTags, options: CameraOptions) -> tuple[Lens, float, tuple[str, ...]]:
    """The lens for the stored image, the relative sigma of its focal length, and notes."""
    if options.calibration is not None:
        if options.calibration.image_size != tags.size:
            width, height = options.calibration.image_size
            raise InputFileError(
                f"{path}: it has {tags.size[0]} x {tags.size[1]} pixels, --camera is for {width} x {height}"
            )
        return options.calibration.lens, 0.0, ("lens by --camera",)
    if options.hfov_deg is not None:
        _require_shape(path, tags.size, with_stated_size(tags).size)
        focal = 0.5 * tags.size[0] / tan(0.5 * radians(options.hfov_deg))
        return _made(path, lens_from_field_of_view(tags.size, focal, GIVEN_FIELD_SIGMA, "--hfov"), tags.size)
    if path.name in options.lenses:
        return _made(path, options.lenses[path.name], tags.size)
    found = lens_from_tags(with_stated_size(tags))
    if isinstance(found, NoLens):
        raise InputFileError(f"{path}: {found.reason}")
    return _made(path, found, tags.size)


def _made(path: Path, lens: PictureLens, size: tuple[int, int]) -> tuple[Lens, float, tuple[str, ...]]:
    notes = (f"focal length by {lens.source}, within {lens.focal_sigma:.1%}", *lens.notes)
    across, along = size[0] / lens.size[0], size[1] / lens.size[1]
    if size != lens.size:
        _require_shape(path, size, lens.size)
        notes = (*notes, f"resized from {lens.size[0]} x {lens.size[1]} pixels: the lens is scaled with it")
    u, v = lens.principal_point
    try:
        made = BrownConrady(
            (lens.focal_px[0] * across, lens.focal_px[1] * along),
            ((u + 0.5) * across - 0.5, (v + 0.5) * along - 0.5),
            lens.distortion,
            size,
        )
    except ValueError as error:
        raise InputFileError(f"{path}: {lens.source}: {error}; give --camera FILE") from None
    return made, lens.focal_sigma, notes


def _require_shape(path: Path, size: tuple[int, int], taken: tuple[int, int]) -> None:
    """InputFileError for a picture that was cropped: nothing says where the optical axis is in it."""
    if abs(size[0] * taken[1] / (size[1] * taken[0]) - 1.0) > SAME_SHAPE:
        raise InputFileError(
            f"{path}: {size[0]} x {size[1]} pixels, taken with {taken[0]} x {taken[1]}: another shape; "
            "give --camera FILE for it"
        )


def _stored(viewed: Pixel, size: tuple[int, int], turned: int) -> Pixel:
    """The stored pixel by EXIF 2.32's table of orientations; ``size``: of the stored image."""
    u, v = viewed
    right, bottom = size[0] - 1, size[1] - 1
    return {
        2: (right - u, v),
        3: (right - u, bottom - v),
        4: (u, bottom - v),
        5: (v, u),
        6: (v, bottom - u),
        7: (right - v, bottom - u),
        8: (right - v, u),
    }.get(turned, (u, v))
