"""Comparison of a new lens with earlier camera files: the one it replaces, and the one named by --compare."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import degrees
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np

from fwav_companion.camera import file_and_camera, parse_calibration
from fwav_companion.camera.batch import camera_rays_from_pixels
from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import open_regular
from fwav_companion.tools.calibrate.lens_fit.reprojection import Floats
from fwav_companion.types import Lens

LARGEST_BYTES: Final = 1 << 20
"""A calibration has some hundred bytes; a file of a megabyte is another file."""
ACROSS: Final = 41
"""Pixels along each side of the image at which the rays are compared."""


class PreviousLens(msgspec.Struct, frozen=True):
    """An earlier camera file."""

    name: str
    """Path of the file."""
    lens: Lens | None
    """Lens in the file; None where it is unreadable."""
    trouble: str = ""
    """Why the file is unreadable."""


class LensDifference(msgspec.Struct, frozen=True):
    """The angles between the rays of two lenses at the same pixels."""

    rms: float
    """RMS angle, radians."""
    largest: float
    """Largest angle, radians."""
    rms_without_rotation: float
    """RMS angle after the best rotation of one lens, radians: a calibration of the mount finds this rotation."""


def read_previous(named: Path | None, replaced: Path) -> list[PreviousLens]:
    """The camera files to compare with. InputFileError where ``named`` is not one; ``replaced`` may be any file."""
    found = [] if named is None else [PreviousLens(str(named), _lens(named))]
    if replaced.exists():
        try:
            found.append(PreviousLens(str(replaced), _lens(replaced)))
        except InputFileError as error:
            found.append(PreviousLens(str(replaced), None, str(error)))
    return found


def comparisons(lens: Lens, previous: Sequence[PreviousLens]) -> Iterator[tuple[str, dict[str, Any]]]:
    """A line of text and a JSON object for each earlier file."""
    for other in previous:
        reason = other.trouble
        if other.lens is not None and other.lens.image_size != lens.image_size:
            reason = f"{other.name}: for {other.lens.image_size[0]} x {other.lens.image_size[1]} pixels"
        between = None if other.lens is None or reason else lens_difference(lens, other.lens)
        if between is None:
            reason = reason or f"{other.name}: no pixel is valid in both"
            yield f"not compared: {reason}", {"file": other.name, "not_compared": reason}
            continue
        rms, largest, rest = (degrees(each) for each in (between.rms, between.largest, between.rms_without_rotation))
        line = f"against {other.name}: rays differ by {rms:.3f}° RMS over the image, at most by {largest:.3f}°, and"
        entry = {"file": other.name, "rms_deg": rms, "largest_deg": largest, "rms_mount_known_deg": rest}
        yield f"{line} by {rest:.3f}° RMS once the mount is calibrated", entry


def lens_difference(one: Lens, other: Lens) -> LensDifference | None:
    """The difference over the image, evenly sampled; both of one image size. None where no pixel is valid in both."""
    width, height = one.image_size
    u, v = np.meshgrid(np.linspace(0.0, width - 1.0, ACROSS), np.linspace(0.0, height - 1.0, ACROSS))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)
    (ours, valid), (theirs, valid_too) = camera_rays_from_pixels(one, pixels), camera_rays_from_pixels(other, pixels)
    both = valid & valid_too
    if not both.any():
        return None
    ours, theirs = ours[both], theirs[both]
    angles = _angles(ours, theirs)
    u_, _, vt = np.linalg.svd(ours.T @ theirs)
    rotation = u_ @ np.diag([1.0, 1.0, np.linalg.det(u_ @ vt)]) @ vt
    return LensDifference(_rms(angles), float(angles.max()), _rms(_angles(ours, theirs @ rotation.T)))


def _angles(one: Floats, other: Floats) -> Floats:
    """The angles between unit rays, (N,), radians; by the sine, which is accurate for small angles."""
    angles: Floats = np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), (one * other).sum(axis=1))
    return angles


def _rms(values: Floats) -> float:
    return float(np.sqrt((values**2).mean()))


def _lens(path: Path) -> Lens:
    named, camera = file_and_camera(str(path))
    accepted = "accepted: a camera file, as `init` writes one"
    try:
        with open_regular(Path(named)) as file:
            text = file.read(LARGEST_BYTES).decode()
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror}; {accepted}") from None
    except UnicodeDecodeError as error:
        raise InputFileError(f"{path}: byte {error.start} is not UTF-8; {accepted}") from None
    return parse_calibration(text, named, camera=camera).lens
