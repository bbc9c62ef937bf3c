"""One picture of how good a calibration is: people would rather look than read."""

from __future__ import annotations

from math import degrees
from pathlib import Path
from typing import Any, Final

import numpy as np

from fwav_companion.errors import UserError
from fwav_companion.libraries import require
from fwav_companion.on_disk import made_folder, whole
from fwav_companion.tools.calibrate.lens_fit.fit import Fitted, image_angle
from fwav_companion.tools.calibrate.lens_fit.projection import RADIAL, STRETCH, U0, V0, radius
from fwav_companion.tools.calibrate.lens_fit.writing import limit_deg
from fwav_companion.tools.calibrate.telling import Row

FILE: Final = "calibration.png"
LONG: Final = 0.05
"""Of the image's width: as long a typical residual is drawn."""
BINS: Final = 16
WIDER: Final = 10.0
"""Sigmas of the radius that are drawn: three are narrower than the line."""
OURS, LIMIT, OFF = "tab:blue", "tab:red", "tab:orange"


def draw(folder: Path, title: str, fitted: Fitted, told: list[Row]) -> Path:
    """The file that was written. UserError: no matplotlib, or the folder cannot be written."""
    require("calibrate --report", "matplotlib")
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(2, 3, figsize=(18, 10), layout="constrained")
    figure.suptitle(title)
    for panel, place in zip((_over_the_image, _radius, _sure, _scatter, _by_angle, _pictures), axes.flat, strict=True):
        panel(place, fitted, told)
    path = folder / FILE
    try:
        made_folder(folder)
        with whole(path) as file:
            figure.savefig(file, format="png", dpi=100, metadata={"Software": None})
    except OSError as error:
        raise UserError(f"{error.filename or folder}: {error.strerror}; a folder to write to is accepted") from error
    finally:
        plt.close(figure)
    return path


def _over_the_image(axes: Any, fitted: Fitted, _told: list[Row]) -> None:
    """Where corners were seen, and by how much each misses."""
    width, height = fitted.image_size
    pixels, residual = _pixels(fitted), _residuals(fitted)
    times = LONG * width / max(3.0 * fitted.noise_px, 1e-9)
    miss = np.linalg.norm(residual, axis=1)
    arrows = axes.quiver(*pixels.T, *(times * residual).T, miss, angles="xy", scale_units="xy", scale=1.0, width=0.002)
    axes.figure.colorbar(arrows, ax=axes, label="px", shrink=0.7)
    step = 10.0 if limit_deg(fitted) < 60.0 else 20.0
    for angle in np.arange(step, limit_deg(fitted), step):
        _ring(axes, fitted, angle, color="0.8", linewidth=0.8)
    _ring(
        axes, fitted, limit_deg(fitted), color=LIMIT, linestyle="--", label=f"the file ends: {limit_deg(fitted):.0f}°"
    )
    axes.plot(fitted.lens[U0], fitted.lens[V0], "+", color=LIMIT, markersize=12, label="principal point")
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), aspect="equal")
    axes.set(
        title=f"What corners miss by, {times:.0f} times as long; a ring every {step:.0f}°",
        xlabel="u, px",
        ylabel="v, px",
    )
    axes.legend(loc="upper right", fontsize="small")


def _ring(axes: Any, fitted: Fitted, angle_deg: float, **style: Any) -> None:
    """Of the rays at an angle from the axis."""
    r, around = float(radius(fitted.lens, np.radians(angle_deg))), np.linspace(0.0, 2.0 * np.pi, 181)
    u, v = r * np.cos(around), fitted.lens[STRETCH] * r * np.sin(around)
    axes.plot(fitted.lens[U0] + u, fitted.lens[V0] + v, **{"zorder": 0, **style})


def _radius(axes: Any, fitted: Fitted, _told: list[Row]) -> None:
    """The lens, among those that people know."""
    corner = image_angle(fitted)
    end = np.radians(limit_deg(fitted)) if corner is None else max(corner, np.radians(limit_deg(fitted)))
    theta, focal = np.linspace(0.0, end, 300), fitted.lens[RADIAL]
    r, sigma, band = radius(fitted.lens, theta), _radius_sigma(fitted, theta), f"{WIDER:.0f} sigmas"
    axes.fill_between(np.degrees(theta), r - WIDER * sigma, r + WIDER * sigma, color=OURS, alpha=0.3, label=band)
    axes.plot(np.degrees(theta), r, color=OURS, label="this lens")
    axes.plot(np.degrees(theta), focal * theta, ":", color="0.4", label="f θ")
    steep = theta < np.radians(80.0)
    axes.plot(np.degrees(theta[steep]), focal * np.tan(theta[steep]), "--", color="0.6", label="f tan θ, a pinhole")
    axes.axvline(degrees(fitted.claim.reached), color=OFF, linestyle=":", label="corners reach")
    axes.axvline(limit_deg(fitted), color=LIMIT, linestyle="--", label="the file ends")
    axes.set(title="Radius by angle", xlabel="θ from the axis, °", ylabel="r, px", ylim=(0.0, 1.25 * r.max()))
    axes.legend(fontsize="small")


def _radius_sigma(fitted: Fitted, theta: Any) -> Any:
    """(N,) of r alone, pixels."""
    orders = 2 * np.arange(fitted.coefficients) + 1
    powers = theta[:, None] ** orders
    covariance = fitted.claim.covariance[RADIAL:, RADIAL:]
    return np.sqrt(np.einsum("ni,ij,nj->n", powers, covariance, powers))


def _sure(axes: Any, fitted: Fitted, _told: list[Row]) -> None:
    """One sigma of a ray, over how many corners it rests on."""
    theta = np.linspace(0.0, np.radians(limit_deg(fitted)), 100)
    total, beside = fitted.ray_sigmas(theta)
    axes.plot(np.degrees(theta), np.degrees(total), color=OURS, label="a ray by itself")
    axes.plot(np.degrees(theta), np.degrees(beside), "--", color=OURS, label="once the mount is found")
    axes.axvline(degrees(fitted.claim.reached), color=OFF, linestyle=":", label="corners reach")
    axes.set(title="How sure a ray is", xlabel="θ from the axis, °", ylabel="one sigma, °", yscale="log")
    counts = axes.twinx()
    counts.hist(np.degrees(_angles(fitted)), bins=BINS, color="0.85")
    counts.set_ylabel("corners")
    axes.set_zorder(counts.get_zorder() + 1)
    axes.patch.set_visible(False)
    axes.legend(fontsize="small", loc="lower right")


def _scatter(axes: Any, fitted: Fitted, _told: list[Row]) -> None:
    """All residuals about zero: a cloud without a shape, if the pictures are good."""
    residual, sigma = _residuals(fitted), fitted.noise_px
    for seen in fitted.seen:
        axes.plot(*seen.residuals.T, ".", markersize=3)
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
    axes.set_title(f"Residuals, a colour a picture: {sigma:.3f} px an axis")
    axes.legend(fontsize="small")


def _by_angle(axes: Any, fitted: Fitted, _told: list[Row]) -> None:
    """Residuals outwards: what the polynomial cannot follow shows as a wave."""
    outward = _pixels(fitted) - fitted.lens[:2]
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
    miss, angle = (_residuals(fitted) * outward).sum(axis=1), np.degrees(_angles(fitted))
    axes.plot(angle, miss, ".", color="0.7", markersize=3, label="a corner")
    order = np.array_split(np.argsort(angle), BINS)
    middles = [float(angle[each].mean()) for each in order]
    means = [float(miss[each].mean()) for each in order]
    errors = [float(miss[each].std() / np.sqrt(len(each))) for each in order]
    axes.errorbar(middles, means, errors, fmt="o-", color=OURS, capsize=2, label="mean of a sixteenth, one sigma")
    axes.axhline(0.0, color="black", linewidth=0.8)
    axes.set(title="Residuals outwards from the axis: flat, if the lens is of this model", xlabel="θ from the axis, °")
    axes.set_ylabel("px")
    axes.legend(fontsize="small")


def _pictures(axes: Any, fitted: Fitted, told: list[Row]) -> None:
    """Each picture's own; those that are not used by a cross."""
    used = [i for i, row in enumerate(told) if row.used]
    left = [i for i, row in enumerate(told) if not row.used]
    axes.bar(used, [told[i].rms_px or 0.0 for i in used], color=OURS, label="used")
    axes.plot(left, [fitted.noise_px * 0.1] * len(left), "x", color=LIMIT, label="not used")
    axes.axhline(fitted.noise_px, color="0.3", linewidth=1, label="all")
    step = max(1, len(told) // 25)
    names = [Path(row.name).name for row in told]
    axes.set_xticks(range(0, len(told), step), names[::step], rotation=75, fontsize="small")
    axes.set(title="RMS of an axis by picture", ylabel="px")
    axes.legend(fontsize="small")


def _pixels(fitted: Fitted) -> Any:
    return np.concatenate([seen.view.pixels for seen in fitted.seen])


def _residuals(fitted: Fitted) -> Any:
    return np.concatenate([seen.residuals for seen in fitted.seen])


def _angles(fitted: Fitted) -> Any:
    return np.concatenate([seen.angles for seen in fitted.seen])
