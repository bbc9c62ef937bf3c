"""The figure of a calibration: residuals, radius, accuracy of rays, and pictures, in six panels."""

from __future__ import annotations

from math import degrees
from pathlib import Path
from typing import Any, Final

import numpy as np

from fwav_companion.errors import UserError
from fwav_companion.libraries import require
from fwav_companion.on_disk import made_folder, whole
from fwav_companion.tools.calibrate.calibration_summary import PictureRow
from fwav_companion.tools.calibrate.lens_fit.lens_fit import FittedLens
from fwav_companion.tools.calibrate.lens_fit.reprojection import ASPECT, RADIAL, U0, V0, Floats, odd_powers, radius

FILE: Final = "calibration.png"
ARROW: Final = 0.05
"""Length of the arrow of three residual sigmas, as a share of the image's width."""
BINS: Final = 16
BAND: Final = 10.0
"""Width of the band about the radius, sigmas: three are narrower than the line."""
OURS, LIMIT, OFF = "tab:blue", "tab:red", "tab:orange"


def draw_calibration(folder: Path, title: str, fitted: FittedLens, rows: list[PictureRow]) -> Path:
    """The path of the figure, after writing it. UserError: matplotlib is missing, or the folder cannot be written."""
    require("calibrate --report", "matplotlib")
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(2, 3, figsize=(18, 10), layout="constrained")
    figure.suptitle(title)
    for panel, place in zip(
        (_over_the_image, _radius, _ray_accuracy, _scatter, _by_angle, _pictures), axes.flat, strict=True
    ):
        panel(place, fitted, rows)
    path = folder / FILE
    try:
        made_folder(folder)
        with whole(path) as file:
            figure.savefig(file, format="png", dpi=100, metadata={"Software": None})
    except OSError as error:
        raise UserError(f"{error.filename or folder}: {error.strerror}; accepted: a folder to write to") from error
    finally:
        plt.close(figure)
    return path


def _over_the_image(axes: Any, fitted: FittedLens, _rows: list[PictureRow]) -> None:
    """Draw the residual of each corner at its place in the image."""
    width, height = fitted.image_size
    pixels, residual = _pixels(fitted), _residuals(fitted)
    times = ARROW * width / max(3.0 * fitted.noise_px, 1e-9)
    miss = np.linalg.norm(residual, axis=1)
    arrows = axes.quiver(*pixels.T, *(times * residual).T, miss, angles="xy", scale_units="xy", scale=1.0, width=0.002)
    axes.figure.colorbar(arrows, ax=axes, label="px", shrink=0.7)
    step = 10.0 if fitted.valid_deg < 60.0 else 20.0
    for angle in np.arange(step, fitted.valid_deg, step):
        _ring(axes, fitted, angle, color="0.8", linewidth=0.8)
    _ring(axes, fitted, fitted.valid_deg, color=LIMIT, linestyle="--", label=f"the file ends: {fitted.valid_deg:.0f}°")
    axes.plot(fitted.lens[U0], fitted.lens[V0], "+", color=LIMIT, markersize=12, label="principal point")
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), aspect="equal")
    axes.set(
        title=f"Residuals of corners, {times:.0f} times enlarged; a ring every {step:.0f}°",
        xlabel="u, px",
        ylabel="v, px",
    )
    axes.legend(loc="upper right", fontsize="small")


def _ring(axes: Any, fitted: FittedLens, angle_deg: float, **style: Any) -> None:
    """Draw the ring of the pixels at an angle from the axis."""
    r, around = float(radius(fitted.lens, np.radians(angle_deg))), np.linspace(0.0, 2.0 * np.pi, 181)
    u, v = r * np.cos(around), fitted.lens[ASPECT] * r * np.sin(around)
    axes.plot(fitted.lens[U0] + u, fitted.lens[V0] + v, **{"zorder": 0, **style})


def _radius(axes: Any, fitted: FittedLens, _rows: list[PictureRow]) -> None:
    """Draw the radius by the angle, with an equidistant lens and a pinhole of the same focal length."""
    corner = fitted.image_angle
    end = np.radians(fitted.valid_deg) if corner is None else max(corner, np.radians(fitted.valid_deg))
    theta, focal = np.linspace(0.0, end, 300), fitted.lens[RADIAL]
    r, sigma, band = radius(fitted.lens, theta), _radius_sigma(fitted, theta), f"{BAND:.0f} sigmas"
    axes.fill_between(np.degrees(theta), r - BAND * sigma, r + BAND * sigma, color=OURS, alpha=0.3, label=band)
    axes.plot(np.degrees(theta), r, color=OURS, label="this lens")
    axes.plot(np.degrees(theta), focal * theta, ":", color="0.4", label="f θ")
    steep = theta < np.radians(80.0)
    axes.plot(np.degrees(theta[steep]), focal * np.tan(theta[steep]), "--", color="0.6", label="f tan θ, a pinhole")
    axes.axvline(degrees(fitted.accuracy.reached), color=OFF, linestyle=":", label="corners reach")
    axes.axvline(fitted.valid_deg, color=LIMIT, linestyle="--", label="the file ends")
    axes.set(title="Radius by angle", xlabel="θ from the axis, °", ylabel="r, px", ylim=(0.0, 1.25 * r.max()))
    axes.legend(fontsize="small")


def _radius_sigma(fitted: FittedLens, theta: Floats) -> Floats:
    """One sigma of the radius at the angles theta, (N,), pixels."""
    powers, _ = odd_powers(theta, fitted.coefficients)
    covariance = fitted.accuracy.covariance[RADIAL:, RADIAL:]
    sigma: Floats = np.sqrt(np.einsum("ni,ij,nj->n", powers, covariance, powers))
    return sigma


def _ray_accuracy(axes: Any, fitted: FittedLens, _rows: list[PictureRow]) -> None:
    """Draw one sigma of a ray by the angle, above a histogram of the corners."""
    theta = np.linspace(0.0, np.radians(fitted.valid_deg), 100)
    total, rest = fitted.ray_sigmas(theta)
    axes.plot(np.degrees(theta), np.degrees(total), color=OURS, label="a ray by itself")
    axes.plot(np.degrees(theta), np.degrees(rest), "--", color=OURS, label="once the mount is calibrated")
    axes.axvline(degrees(fitted.accuracy.reached), color=OFF, linestyle=":", label="corners reach")
    axes.set(title="Accuracy of a ray", xlabel="θ from the axis, °", ylabel="one sigma, °", yscale="log")
    counts = axes.twinx()
    counts.hist(np.degrees(_angles(fitted)), bins=BINS, color="0.85")
    counts.set_ylabel("corners")
    axes.set_zorder(counts.get_zorder() + 1)
    axes.patch.set_visible(False)
    axes.legend(fontsize="small", loc="lower right")


def _scatter(axes: Any, fitted: FittedLens, _rows: list[PictureRow]) -> None:
    """Draw all residuals about zero: a round cloud, if the pictures are good."""
    residual, sigma = _residuals(fitted), fitted.noise_px
    for view in fitted.views:
        axes.plot(*view.residuals.T, ".", markersize=3)
    around = np.linspace(0.0, 2.0 * np.pi, 181)
    for times in (1.0, 3.0):
        label = f"{times:.0f} sigma" + "s" * (times > 1.0)
        axes.plot(
            times * sigma * np.cos(around),
            times * sigma * np.sin(around),
            color="0.3",
            linewidth=1.0 / times,
            label=label,
        )
    reach = 1.1 * max(float(np.abs(residual).max()), 3.0 * sigma)
    axes.set(xlim=(-reach, reach), ylim=(reach, -reach), aspect="equal", xlabel="u, px", ylabel="v, px")
    axes.set_title(f"Residuals, one colour for each picture: {sigma:.3f} px an axis")
    axes.legend(fontsize="small")


def _by_angle(axes: Any, fitted: FittedLens, _rows: list[PictureRow]) -> None:
    """Draw the radial residuals by the angle: an error of the polynomial shows as a wave."""
    outward = _pixels(fitted) - fitted.lens[:2]
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
    radial, angle = (_residuals(fitted) * outward).sum(axis=1), np.degrees(_angles(fitted))
    axes.plot(angle, radial, ".", color="0.7", markersize=3, label="a corner")
    order = np.array_split(np.argsort(angle), BINS)
    middles = [float(angle[each].mean()) for each in order]
    means = [float(radial[each].mean()) for each in order]
    errors = [float(radial[each].std() / np.sqrt(len(each))) for each in order]
    axes.errorbar(middles, means, errors, fmt="o-", color=OURS, capsize=2, label="mean of a sixteenth, one sigma")
    axes.axhline(0.0, color="black", linewidth=0.8)
    axes.set(title="Radial residuals: flat, if the lens is of this model", xlabel="θ from the axis, °")
    axes.set_ylabel("px")
    axes.legend(fontsize="small")


def _pictures(axes: Any, fitted: FittedLens, rows: list[PictureRow]) -> None:
    """Draw the RMS of each picture; a cross marks one that is not used."""
    used = [i for i, row in enumerate(rows) if row.used]
    left = [i for i, row in enumerate(rows) if not row.used]
    axes.bar(used, [rows[i].rms_px or 0.0 for i in used], color=OURS, label="used")
    axes.plot(left, [fitted.noise_px * 0.1] * len(left), "x", color=LIMIT, label="not used")
    axes.axhline(fitted.noise_px, color="0.3", linewidth=1, label="all")
    step = max(1, len(rows) // 25)
    names = [Path(row.name).name for row in rows]
    axes.set_xticks(range(0, len(rows), step), names[::step], rotation=75, fontsize="small")
    axes.set(title="Reprojection error of one axis by picture, RMS", ylabel="px")
    axes.legend(fontsize="small")


def _pixels(fitted: FittedLens) -> Any:
    return np.concatenate([view.view.pixels for view in fitted.views])


def _residuals(fitted: FittedLens) -> Any:
    return np.concatenate([view.residuals for view in fitted.views])


def _angles(fitted: FittedLens) -> Any:
    return np.concatenate([view.angles for view in fitted.views])
