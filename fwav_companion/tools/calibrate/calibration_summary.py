"""The result of a calibration: a table of pictures, lines of text, the camera file, a JSON object."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import degrees, sqrt
from typing import Any, Final, NamedTuple

import numpy as np

from fwav_companion import __version__
from fwav_companion.tools.calibrate.board_spec import CalibrationBoard
from fwav_companion.tools.calibrate.board_views import BoardSearch
from fwav_companion.tools.calibrate.calibration_verdict import (
    CalibrationVerdict,
    Grade,
    covered_parts,
    least_mount_bias_deg,
    least_pixel_noise_px,
)
from fwav_companion.tools.calibrate.lens_fit.lens_fit import FailedFit, FittedLens
from fwav_companion.tools.calibrate.lens_fit.reprojection import ASPECT, RADIAL, U0, V0

STEPS: Final = 4
"""Angles of the table of ray sigmas between the axis and what corners reach."""
NAMES: Final = ("u0", "v0", "stretch", "c1", "c2", "c3", "c4", "c5")
"""JSON keys of the lens parameters; ``stretch`` is the aspect ratio."""
GAUGE: Final = "k1 is 1: only the products of k_mm and pixels_per_mm matter, here pixels a radian"
POWERS: Final = ("θ", "θ³", "θ⁵", "θ⁷", "θ⁹")


class PictureRow(NamedTuple):
    """One picture in the table and in the JSON object."""

    name: str
    corners: int
    rms_px: float | None
    """Residual RMS of one axis, pixels."""
    tilt_deg: float | None
    reached_deg: float | None
    used: bool
    why: str
    """Why the picture is not used, or how many of its corners were removed."""

    @property
    def reprojection_rms_px(self) -> float | None:
        """The RMS length of a residual, pixels."""
        return None if self.rms_px is None else sqrt(2.0) * self.rms_px


def picture_rows(names: Sequence[str], search: BoardSearch, result: FittedLens | FailedFit) -> list[PictureRow]:
    """A row for each picture, in the order given."""
    rows = {
        name: PictureRow(name=name, corners=0, rms_px=None, tilt_deg=None, reached_deg=None, used=False, why=why)
        for name, why in search.unused.items()
    }
    for view in search.views:
        rows[view.name] = PictureRow(
            name=view.name, corners=len(view.pixels), rms_px=None, tilt_deg=None, reached_deg=None, used=False, why=""
        )
    for dropped in result.dropped:
        width_px = search.blurred.get(dropped.name)
        blurred = "" if width_px is None else f"; blurred: its edges are {width_px:.0f} px wide"
        why = f"{dropped.why}{blurred}"
        rows[dropped.name] = rows[dropped.name]._replace(rms_px=dropped.rms_px or None, why=why)
    for fitted in result.views if isinstance(result, FittedLens) else ():
        out = f"{fitted.corners_out} corner{'s' * (fitted.corners_out > 1)} removed" if fitted.corners_out else ""
        rows[fitted.view.name] = PictureRow(
            name=fitted.view.name,
            corners=len(fitted.residuals),
            rms_px=fitted.rms_px,
            tilt_deg=degrees(fitted.tilt),
            reached_deg=degrees(float(fitted.angles.max())),
            used=True,
            why=out,
        )
    return [rows[name] for name in names]


def result_lines(search: BoardSearch, fitted: FittedLens, verdict: CalibrationVerdict) -> Iterator[str]:
    """The result as text, up to the verdict."""
    yield from _description(search, fitted, verdict)
    pixel, mount = least_pixel_noise_px(fitted), least_mount_bias_deg(fitted)
    yield f"[uncertainty] pixel_noise_px: at least {pixel:.1f}, the error of corners; a detector of people errs by more"
    yield f"[uncertainty] mount_bias_deg: at least {mount:.2f}, the error of this lens"


def file_comments(
    board: CalibrationBoard, search: BoardSearch, fitted: FittedLens, verdict: CalibrationVerdict
) -> Iterator[str]:
    """The comments of the camera file."""
    yield f"Fitted by fwav-companion {__version__} calibrate to pictures of {board.text}."
    yield from _description(search, fitted, verdict)
    yield from verdict.lines(fitted)


def camera_file(fitted: FittedLens, comments: Iterable[str]) -> str:
    """The text of the camera file that ``parse_calibration`` reads, ``comments`` first.

    Ten digits are a millionth of a thousand pixels.
    """
    focal = fitted.lens[RADIAL]
    k = [c / focal for c in fitted.lens[RADIAL:]] + [0.0] * (5 - fitted.coefficients)
    lines = [
        *(f"# {comment}".rstrip() for comment in comments),
        "model: kannala_brandt",
        f"image_size: [{fitted.image_size[0]}, {fitted.image_size[1]}]",
        f"k_mm: {_listed(k)}  # {GAUGE}",
        f"pixels_per_mm: {_listed([focal, focal * fitted.lens[ASPECT]])}",
        f"principal_point: {_listed([fitted.lens[U0], fitted.lens[V0]])}",
        f"max_angle_deg: {fitted.valid_deg:.2f}  # from the optical axis: rays beyond are refused",
    ]
    return "\n".join(lines) + "\n"


def result_object(
    board: CalibrationBoard, rows: Sequence[PictureRow], fitted: FittedLens, verdict: CalibrationVerdict
) -> dict[str, Any]:
    """The result as a JSON object."""
    lens, names, corner = fitted.lens, NAMES[: len(fitted.lens)], fitted.image_angle
    return {
        "ok": verdict.grade is not Grade.POOR,
        "verdict": verdict.grade.value,
        "usable_deg": verdict.usable_deg,
        "take": list(verdict.remedies),
        "board": board.text,
        "image_size": list(fitted.image_size),
        "lens": dict(zip(names, (float(number) for number in lens), strict=True)),
        "sigma": {name: fitted.sigma(i) for i, name in enumerate(names)},
        "covariance": fitted.accuracy.covariance.tolist(),
        "noise_px": fitted.noise_px,
        "reprojection_rms_px": fitted.reprojection_rms_px,
        "disagreement": fitted.accuracy.inflation,
        "decentring": {"edge_px": fitted.decentring.edge_px, "sigma_px": fitted.decentring.sigma_px},
        "reached_deg": degrees(fitted.accuracy.reached),
        "image_deg": None if corner is None else degrees(corner),
        "max_angle_deg": fitted.valid_deg,
        "parts_covered": list(covered_parts(fitted)),
        "rays": _ray_table(fitted),
        "pixel_noise_px": least_pixel_noise_px(fitted),
        "mount_bias_deg": least_mount_bias_deg(fitted),
        "notes": [weakness.finding for weakness in verdict.weaknesses],
        "pictures": [row._asdict() for row in rows],
    }


def _description(search: BoardSearch, fitted: FittedLens, verdict: CalibrationVerdict) -> Iterator[str]:
    """The pictures, the lens with its sigmas, and the notes."""
    corners = sum(len(view.residuals) for view in fitted.views)
    yield (
        f"{search.pictures} pictures of {search.size[0]} x {search.size[1]}, the board in {len(search.views)}, "
        f"{len(fitted.views)} of them used: {corners} corners"
    )
    if search.reasons:
        yield f"board not found: {search.reasons}"
    yield from _lens_lines(fitted)
    yield from _ray_lines(fitted)
    yield from (f"note: {weakness.finding}" for weakness in verdict.weaknesses)


def _lens_lines(fitted: FittedLens) -> Iterator[str]:
    """The lens parameters with one sigma each, the residuals, and the angles."""
    lens, sigma = fitted.lens, fitted.sigma
    polynomial = " + ".join(f"k{i + 1} {power}" for i, power in enumerate(POWERS[: fitted.coefficients]))
    yield f"r = {polynomial}: the pictures support {fitted.coefficients} of 5 coefficients"
    yield (
        f"focal length {lens[RADIAL]:.2f} ± {sigma(RADIAL):.2f} px a radian, along v "
        f"{lens[ASPECT]:.5f} ± {sigma(ASPECT):.5f} times that"
    )
    yield f"principal point ({lens[U0]:.2f} ± {sigma(U0):.2f}, {lens[V0]:.2f} ± {sigma(V0):.2f})"
    inflated = f"; sigmas inflated {fitted.accuracy.inflation:.1f} times" if fitted.accuracy.inflation > 1.05 else ""
    yield (
        f"reprojection error, RMS: {fitted.reprojection_rms_px:.3f} px ({fitted.noise_px:.3f} px an axis, one sigma)"
        f"{inflated}"
    )
    corner = fitted.image_angle
    ends = "" if corner is None else f", the image's farthest corner {degrees(corner):.1f}°"
    occupied, visible = covered_parts(fitted)
    yield (
        f"corners reach {degrees(fitted.accuracy.reached):.1f}° from the axis, in {occupied} of {visible} parts of the "
        f"image{ends}; the file ends at {fitted.valid_deg:.1f}°"
    )


def _ray_lines(fitted: FittedLens) -> Iterator[str]:
    table = _ray_table(fitted)
    yield "one sigma of a ray at            " + "".join(f"{row['angle_deg']:>8.0f}°" for row in table)
    yield "  by itself                      " + "".join(f"{row['sigma_deg']:>8.3f}°" for row in table)
    yield "  once the mount is calibrated   " + "".join(f"{row['sigma_mount_known_deg']:>8.3f}°" for row in table)


def _ray_table(fitted: FittedLens) -> list[dict[str, float]]:
    """One sigma of a ray at angles from the axis to the file's end, degrees."""
    angles = np.linspace(0.0, fitted.accuracy.reached, STEPS + 1)
    end = np.radians(fitted.valid_deg)
    if end > 1.02 * fitted.accuracy.reached:
        angles = np.append(angles, end)
    total, rest = fitted.ray_sigmas(angles)
    columns = zip(np.degrees(angles), np.degrees(total), np.degrees(rest), strict=True)
    return [{"angle_deg": float(a), "sigma_deg": float(s), "sigma_mount_known_deg": float(b)} for a, s, b in columns]


def _listed(numbers: Iterable[float]) -> str:
    return f"[{', '.join(_number(number) for number in numbers)}]"


def _number(number: float) -> str:
    """The number with a decimal point, which YAML 1.1 demands of a number with an exponent."""
    text = f"{number:.10g}"
    mantissa, e, exponent = text.partition("e")
    return f"{mantissa}{'' if '.' in mantissa else '.0'}{e}{exponent}"
