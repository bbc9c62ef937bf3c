"""Verdict on a calibration: good, usable up to an angle, or poor; what is weak, and which pictures to take."""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum
from math import ceil, degrees, floor, radians
from typing import Final

import msgspec
import numpy as np

from fwav_companion.tools.calibrate.lens_fit.lens_fit import FittedLens
from fwav_companion.tools.calibrate.lens_fit.reprojection import ASPECT, RADIAL, Floats

PARTS: Final = (8, 6)
"""Parts of the image, across and down, in which corners are counted."""
REGIONS: Final = (
    ("upper left", "top", "upper right"),
    ("left", "middle", "right"),
    ("lower left", "bottom", "lower right"),
)
"""Names of the image's regions, each of several parts."""
GOOD_SHARE: Final = 0.7
"""Share of the parts that the lens sees which should hold corners: a board hardly reaches the image's own corners."""
GOOD_REGION: Final = 0.5
"""Share of a region's parts that should hold corners."""
GOOD_REACH: Final = 0.85
"""Share of the angle of the image's farthest corner that corners should reach."""
POOR_REACH: Final = 0.5
"""Share of that angle below which the usable range makes the calibration poor."""
GOOD_VIEWS: Final = 10
"""Fewest pictures of a good calibration: with fewer, an error of one picture is a tenth of the answer or more."""
MANY_VIEWS: Final = 15
GOOD_TILT: Final = radians(25.0)
"""Largest angle between two boards that should be exceeded: at 25 degrees a square is a tenth shorter than face on,
which makes the focal length observable."""
ROUGH_PX: Final = 0.7
"""Residual sigma of one axis of a poor calibration, pixels: corner detectors err by 0.05 to 0.5 px."""
DISAGREE: Final = 2.0
"""Inflation of the sigmas by the disagreement of the pictures, beyond which a calibration is not good."""
SQUARE: Final = 0.004
"""Deviation of the aspect ratio from 1: pixels are square to a thousandth or two, and a print that a printer scaled in
one direction is not."""
SIGNIFICANT: Final = 4.0
"""Sigmas at which a deviation is real."""
GOOD_RAY: Final = radians(0.1)
"""Error of a ray of a good calibration, radians: [uncertainty] attitude_noise_deg of an autopilot."""
POOR_RAY: Final = radians(0.5)
"""Error of a ray that is not usable, radians: it doubles the variance of [uncertainty] attitude_bias_deg."""
RINGS: Final = 64
"""Angles at which the error of rays is evaluated."""


class Grade(Enum):
    """Quality of a calibration, in rising severity."""

    GOOD = "good"
    USABLE = "usable"
    POOR = "poor"


class Weakness(msgspec.Struct, frozen=True):
    """One weakness of a calibration."""

    grade: Grade
    """Best grade that a calibration with this weakness has."""
    finding: str
    """Description of the weakness, for the notes."""
    remedy: str
    """Remedy: the pictures to take, or another action."""


class CalibrationVerdict(msgspec.Struct, frozen=True):
    """The verdict on a calibration."""

    grade: Grade
    """Quality."""
    usable_deg: float
    """Angle from the optical axis up to which rays are accurate to POOR_RAY, degrees."""
    weaknesses: tuple[Weakness, ...]
    """All weaknesses, also those of a good calibration."""

    @property
    def remedies(self) -> tuple[str, ...]:
        """Remedies for the weaknesses that lower the grade."""
        return tuple(each.remedy for each in self.weaknesses if each.grade is not Grade.GOOD)

    def lines(self, fitted: FittedLens) -> Iterator[str]:
        """The verdict as text, and the pictures to take where it is not good."""
        corner = fitted.image_angle
        of = "" if corner is None else f" of {degrees(corner):.0f}°"
        up_to = f"up to {floor(self.usable_deg)}°{of} from the optical axis"
        sigma_deg = degrees(float(_ray_errors(fitted, np.linspace(0.0, radians(self.usable_deg), RINGS + 1)).max()))
        rays = f"rays are accurate to {sigma_deg:.2f}° (one sigma) {up_to}"
        match self.grade:
            case Grade.GOOD:
                yield f"verdict: good: {rays}"
                return
            case Grade.USABLE:
                yield f"verdict: usable {up_to}. To make it good, calibrate again with these pictures too:"
            case Grade.POOR:
                yield f"verdict: poor: {self._worst()}. Take these pictures and calibrate again:"
        yield from (f"  - {remedy}" for remedy in self.remedies)

    def _worst(self) -> str:
        return next(each.finding for each in self.weaknesses if each.grade is Grade.POOR)


def calibration_verdict(fitted: FittedLens) -> CalibrationVerdict:
    """The verdict on a fit: its grade is that of its worst weakness."""
    usable = usable_angle(fitted)
    weaknesses = (
        *_range_weaknesses(fitted, usable),
        *_picture_weaknesses(fitted),
        *_corner_weaknesses(fitted),
        *_model_weaknesses(fitted),
    )
    grades = list(Grade)
    worst = max((grades.index(each.grade) for each in weaknesses), default=0)
    return CalibrationVerdict(grades[worst], degrees(usable), weaknesses)


def usable_angle(fitted: FittedLens) -> float:
    """The angle from the axis, within the valid range, up to which rays are accurate to POOR_RAY, radians."""
    angles = np.linspace(0.0, radians(fitted.valid_deg), RINGS + 1)
    beyond = np.flatnonzero(~(_ray_errors(fitted, angles) < POOR_RAY))
    return float(angles[max(0, beyond[0] - 1)]) if len(beyond) else float(angles[-1])


def covered_parts(fitted: FittedLens) -> tuple[int, int]:
    """The number of image parts with a corner, and of those that the lens sees."""
    occupied, visible = _parts(fitted)
    return int(occupied.sum()), int(visible.sum())


def least_pixel_noise_px(fitted: FittedLens) -> float:
    """The least [uncertainty] pixel_noise_px, rounded up to a tenth: the error of sharp corners."""
    return ceil(10.0 * fitted.noise_px) / 10.0


def least_mount_bias_deg(fitted: FittedLens) -> float:
    """The least [uncertainty] mount_bias_deg: one sigma of the worst ray, whose error is the same through a flight."""
    total, _ = fitted.ray_sigmas(np.linspace(0.0, fitted.accuracy.reached, 9))
    return ceil(100.0 * degrees(float(total.max()))) / 100.0


def _ray_errors(fitted: FittedLens, angles: Floats) -> Floats:
    """One sigma of rays without their common rotation, which a calibration of the mount finds, radians."""
    _, errors = fitted.ray_sigmas(angles)
    return errors


def _range_weaknesses(fitted: FittedLens, usable: float) -> Iterator[Weakness]:
    """Weaknesses of the angles and image regions that corners reach."""
    corner, reached, supported = fitted.image_angle, fitted.accuracy.reached, fitted.accuracy.supported
    occupied, visible = covered_parts(fitted)
    thin = _thin_regions(fitted)
    edges = "show the board at the image's edges and corners"
    where = f"show the board in these regions of the image: {', '.join(thin)}" if thin else "fill the image with boards"
    whole = supported if corner is None else corner
    if usable < POOR_REACH * whole:
        finding = f"rays are usable up to {degrees(usable):.0f}° of {degrees(whole):.0f}° from the optical axis"
        yield Weakness(Grade.POOR, finding, edges)
    elif corner is not None and reached < GOOD_REACH * corner:
        beyond = (
            f"rays beyond {degrees(supported):.0f}° are refused" if supported < corner else "the rest is extrapolated"
        )
        finding = f"corners reach {degrees(reached):.0f}° of the image's {degrees(corner):.0f}° from the axis; {beyond}"
        yield Weakness(Grade.USABLE, finding, edges)
    if occupied < GOOD_SHARE * visible:
        yield Weakness(Grade.USABLE, f"corners are in {occupied} of {visible} parts of the image", where)
    error = float(_ray_errors(fitted, np.array([GOOD_REACH * usable]))[0])
    if error > GOOD_RAY:
        finding = f"one sigma of a ray {degrees(GOOD_REACH * usable):.0f}° off the axis is {degrees(error):.2f}°"
        yield Weakness(Grade.USABLE, finding, "show the board large in the image, and tilted to all sides")


def _picture_weaknesses(fitted: FittedLens) -> Iterator[Weakness]:
    """Weaknesses of the number and the tilts of the pictures."""
    count = len(fitted.views)
    if count < GOOD_VIEWS:
        finding = f"{count} pictures: an error in one of them is a tenth of the answer or more"
        yield Weakness(Grade.USABLE, finding, f"take {MANY_VIEWS - count} more pictures, from all sides")
    if fitted.largest_tilt < GOOD_TILT:
        tilt = f"no two boards are tilted against each other by more than {degrees(fitted.largest_tilt):.0f}°"
        yield Weakness(Grade.USABLE, tilt, "tilt the board by 30° to 45°: to the left, to the right, up and down")


def _corner_weaknesses(fitted: FittedLens) -> Iterator[Weakness]:
    """Weaknesses of the corners' residuals."""
    if fitted.noise_px > ROUGH_PX * fitted.enlargement:
        finding = f"the reprojection error is {fitted.noise_px:.1f} px an axis, in good pictures 0.1 to 0.3"
        yield Weakness(Grade.POOR, finding, "take sharp pictures in good light, and glue the board to something flat")
    if fitted.accuracy.inflation > DISAGREE:
        finding = (
            f"pictures disagree by {fitted.accuracy.inflation:.1f} times their corners' scatter, and every sigma is "
            "inflated by this factor"
        )
        yield Weakness(Grade.USABLE, finding, "glue the board to something flat, and hold it still")


def _model_weaknesses(fitted: FittedLens) -> Iterator[Weakness]:
    """Weaknesses that no sigma contains: errors that all pictures share."""
    focal, reached = float(fitted.lens[RADIAL]), fitted.accuracy.reached
    edge_px, sigma_px = fitted.decentring.edge_px, fitted.decentring.sigma_px
    if edge_px > SIGNIFICANT * sigma_px:
        at = f"by {edge_px:.1f} ± {sigma_px:.1f} px at {degrees(reached):.0f}°"
        finding = f"the lens elements are decentred, {at}: this model has no term for it, and no sigma here contains it"
        remedy = f"set [uncertainty] mount_bias_deg to at least {degrees(edge_px / focal):.2f}, or use another lens"
        yield Weakness(_grade_of_error(edge_px / focal), finding, remedy)
    deviation, sigma = abs(float(fitted.lens[ASPECT]) - 1.0), fitted.sigma(ASPECT)
    if deviation > SQUARE + SIGNIFICANT * sigma:
        finding = f"pixels come out {100.0 * deviation:.1f} % off square: the print may be scaled in one direction"
        yield Weakness(
            _grade_of_error(deviation * reached),
            finding,
            "measure the print along both its sides, and print it again if they differ",
        )


def _grade_of_error(angle: float) -> Grade:
    """The best grade of a calibration whose rays have this error, radians."""
    return Grade.GOOD if angle < GOOD_RAY else Grade.USABLE if angle < POOR_RAY else Grade.POOR


def _parts(fitted: FittedLens) -> tuple[Floats, Floats]:
    """The parts of the image with a corner, and those that the lens sees; both (across, down), 1.0 or 0.0."""
    width, height = fitted.image_size
    pixels = np.concatenate([view.view.pixels for view in fitted.views])
    cells = np.clip((pixels + 0.5) / (width, height) * PARTS, 0, np.array(PARTS) - 1).astype(int)
    occupied = np.zeros(PARTS)
    occupied[cells[:, 0], cells[:, 1]] = 1.0
    i, j = np.meshgrid(np.arange(PARTS[0]), np.arange(PARTS[1]), indexing="ij")
    u, v = (i + 0.5) * width / PARTS[0] - 0.5, (j + 0.5) * height / PARTS[1] - 0.5
    r = np.hypot(u - fitted.lens[0], (v - fitted.lens[1]) / fitted.lens[ASPECT])
    reach = np.linalg.norm(pixels - fitted.lens[:2], axis=1).max()
    sees_all = fitted.image_angle is not None
    return occupied, np.maximum(occupied, np.ones(PARTS) if sees_all else (r <= reach).astype(float))


def _thin_regions(fitted: FittedLens) -> list[str]:
    """The names of the image regions with few corners."""
    occupied, visible = _parts(fitted)
    column, row = (np.arange(parts) * len(REGIONS) // parts for parts in PARTS)
    thin = []
    for down, names in enumerate(REGIONS):
        for across, name in enumerate(names):
            region = np.ix_(column == across, row == down)
            if occupied[region].sum() < GOOD_REGION * visible[region].sum():
                thin.append(name)
    return thin
