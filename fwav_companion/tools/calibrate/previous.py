"""Camera files that a new one is compared with: the one it takes the place of, and one that is named."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import degrees
from pathlib import Path
from typing import Any, Final

import msgspec

from fwav_companion.camera import parse_calibration
from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import opened
from fwav_companion.tools.calibrate.lens_fit.comparison import rays_apart
from fwav_companion.types import Lens

LARGEST_BYTES: Final = 1 << 20
"""A calibration has some hundred bytes; what has a megabyte is another file."""


class Previous(msgspec.Struct, frozen=True):
    """A camera file that was there before."""

    name: str
    lens: Lens | None
    trouble: str = ""
    """Why there is no lens in it."""


def read_previous(named: Path | None, replaced: Path) -> list[Previous]:
    """InputFileError where the one that is named is no camera file; one that is only replaced may be anything."""
    found = [] if named is None else [Previous(str(named), _lens(named))]
    if replaced.exists():
        try:
            found.append(Previous(str(replaced), _lens(replaced)))
        except InputFileError as error:
            found.append(Previous(str(replaced), None, str(error)))
    return found


def apart(lens: Lens, previous: Sequence[Previous]) -> Iterator[tuple[str, dict[str, Any]]]:
    """For each a line for people and an object for scripts."""
    for other in previous:
        reason = other.trouble
        if other.lens is not None and other.lens.image_size != lens.image_size:
            reason = f"{other.name}: for {other.lens.image_size[0]} x {other.lens.image_size[1]} pixels"
        between = None if other.lens is None or reason else rays_apart(lens, other.lens)
        if between is None:
            told = reason or f"{other.name}: no pixel is seen by both"
            yield f"not compared: {told}", {"file": other.name, "not_compared": told}
            continue
        rms, largest, beside = (degrees(angle) for angle in (between.rms, between.largest, between.rms_beside_turn))
        told = f"against {other.name}: rays {rms:.3f}° apart (RMS over the image; at most {largest:.3f}°)"
        yield (
            f"{told}, {beside:.3f}° once the mount is found",
            {"file": other.name, "rms_deg": rms, "largest_deg": largest, "rms_mount_known_deg": beside},
        )


def _lens(path: Path) -> Lens:
    accepted = "accepted: a camera file, as `init` writes one"
    try:
        with opened(path) as file:
            text = file.read(LARGEST_BYTES).decode()
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror}; {accepted}") from None
    except UnicodeDecodeError as error:
        raise InputFileError(f"{path}: byte {error.start} is not UTF-8; {accepted}") from None
    return parse_calibration(text, str(path)).lens
