"""The result in a table, in lines, as comments of the file that is written, and as one object."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import degrees
from typing import Any, Final, NamedTuple

import numpy as np

from fwav_companion import __version__
from fwav_companion.tools.calibrate.boards.spec import Board
from fwav_companion.tools.calibrate.lens_fit.fit import Fitted, Unfitted, image_angle
from fwav_companion.tools.calibrate.lens_fit.projection import RADIAL, STRETCH, U0, V0
from fwav_companion.tools.calibrate.lens_fit.writing import limit_deg
from fwav_companion.tools.calibrate.looking import Looked
from fwav_companion.tools.calibrate.verdict import covered, least_mount_bias_deg, least_pixel_noise_px, notes

STEPS: Final = 4
"""Between the axis and what corners reach."""
NAMES: Final = ("u0", "v0", "stretch", "c1", "c2", "c3", "c4", "c5")
POWERS: Final = ("θ", "θ³", "θ⁵", "θ⁷", "θ⁹")


class Row(NamedTuple):
    """One picture."""

    name: str
    corners: int
    rms_px: float | None
    tilt_deg: float | None
    reached_deg: float | None
    used: bool
    why: str
    """Why not, or what of it is not."""


def rows(names: Sequence[str], looked: Looked, result: Fitted | Unfitted) -> list[Row]:
    """Of every picture, in the order given."""
    told = {name: Row(name, 0, None, None, None, False, why) for name, why in looked.unused.items()}
    for view in looked.views:
        told[view.name] = Row(view.name, len(view.pixels), None, None, None, False, "")
    for dropped in result.dropped:
        told[dropped.name] = told[dropped.name]._replace(rms_px=dropped.rms_px or None, why=dropped.why)
    for seen in result.seen if isinstance(result, Fitted) else ():
        out = f"{seen.corners_out} corner{'s' * (seen.corners_out > 1)} thrown out" if seen.corners_out else ""
        tilt, reached = degrees(seen.tilt), degrees(float(seen.angles.max()))
        told[seen.view.name] = Row(seen.view.name, len(seen.residuals), seen.rms_px, tilt, reached, True, out)
    return [told[name] for name in names]


def lines(looked: Looked, fitted: Fitted) -> Iterator[str]:
    """For people."""
    yield counted(looked, fitted)
    yield from numbers(fitted)
    yield from _rays(fitted)
    yield from (f"note: {note}" for note in notes(fitted))
    pixel, mount = least_pixel_noise_px(fitted), least_mount_bias_deg(fitted)
    least = f"pixel_noise_px: at least {pixel:.1f}, as corners have it; a finder of people errs by more"
    yield f"[uncertainty] {least}. mount_bias_deg: at least {mount:.2f}, this lens's own"


def counted(looked: Looked, fitted: Fitted) -> str:
    """Pictures and corners."""
    total, seen = looked.pictures, len(looked.views)
    corners = sum(len(view.residuals) for view in fitted.seen)
    size = f"{looked.size[0]} x {looked.size[1]}"
    return f"{total} pictures of {size}, the board in {seen}, {len(fitted.seen)} of them used: {corners} corners"


def numbers(fitted: Fitted) -> Iterator[str]:
    """The lens, each number with its one sigma."""
    lens, sigma = fitted.lens, fitted.sigma
    polynomial = " + ".join(f"k{i + 1} {power}" for i, power in enumerate(POWERS[: fitted.coefficients]))
    yield f"r = {polynomial}: so many coefficients the pictures support"
    yield (
        f"focal length {lens[RADIAL]:.2f} ± {sigma(RADIAL):.2f} px a radian, along v "
        f"{lens[STRETCH]:.5f} ± {sigma(STRETCH):.5f} times that"
    )
    yield f"principal point ({lens[U0]:.2f} ± {sigma(U0):.2f}, {lens[V0]:.2f} ± {sigma(V0):.2f})"
    widened = f", sigmas widened {fitted.claim.disagreement:.1f} times" if fitted.claim.disagreement > 1.05 else ""
    yield f"corners miss by {fitted.noise_px:.3f} px an axis{widened}"
    corner = image_angle(fitted)
    ends = "" if corner is None else f", the image's farthest corner {degrees(corner):.1f}°"
    with_corners, parts = covered(fitted)
    yield (
        f"corners reach {degrees(fitted.claim.reached):.1f}° from the axis, in {with_corners} of {parts} parts of the "
        f"image{ends}; the file ends at {limit_deg(fitted):.1f}°"
    )


def ray_table(fitted: Fitted) -> list[dict[str, float]]:
    """One sigma of a ray at angles from the axis to the file's end, degrees."""
    angles = np.linspace(0.0, fitted.claim.reached, STEPS + 1)
    end = np.radians(limit_deg(fitted))
    if end > 1.02 * fitted.claim.reached:
        angles = np.append(angles, end)
    total, beside = fitted.ray_sigmas(angles)
    columns = zip(np.degrees(angles), np.degrees(total), np.degrees(beside), strict=True)
    return [{"angle_deg": float(a), "sigma_deg": float(s), "sigma_mount_known_deg": float(b)} for a, s, b in columns]


def _rays(fitted: Fitted) -> Iterator[str]:
    table = ray_table(fitted)
    yield "one sigma of a ray at       " + "".join(f"{row['angle_deg']:>8.0f}°" for row in table)
    yield "  by itself                 " + "".join(f"{row['sigma_deg']:>8.3f}°" for row in table)
    yield "  once the mount is found   " + "".join(f"{row['sigma_mount_known_deg']:>8.3f}°" for row in table)


def comments(board: Board, looked: Looked, fitted: Fitted) -> Iterator[str]:
    """What the file says of itself."""
    yield f"Fitted by fwav-companion {__version__} calibrate to pictures of {board.text}."
    yield f"{counted(looked, fitted)}."
    yield from numbers(fitted)
    yield from _rays(fitted)
    yield from (f"note: {note}" for note in notes(fitted))


def as_object(board: Board, told: Sequence[Row], fitted: Fitted) -> dict[str, Any]:
    """For scripts."""
    lens, names = fitted.lens, NAMES[: len(fitted.lens)]
    corner = image_angle(fitted)
    return {
        "ok": True,
        "board": board.text,
        "image_size": list(fitted.image_size),
        "lens": dict(zip(names, (float(number) for number in lens), strict=True)),
        "sigma": {name: fitted.sigma(i) for i, name in enumerate(names)},
        "covariance": fitted.claim.covariance.tolist(),
        "noise_px": fitted.noise_px,
        "disagreement": fitted.claim.disagreement,
        "decentring": {"edge_px": fitted.decentring.edge_px, "sigma_px": fitted.decentring.sigma_px},
        "reached_deg": degrees(fitted.claim.reached),
        "image_deg": None if corner is None else degrees(corner),
        "max_angle_deg": limit_deg(fitted),
        "parts_covered": list(covered(fitted)),
        "rays": ray_table(fitted),
        "pixel_noise_px": least_pixel_noise_px(fitted),
        "mount_bias_deg": least_mount_bias_deg(fitted),
        "notes": list(notes(fitted)),
        "pictures": [row._asdict() for row in told],
    }
