"""The lens fit: from board corners in pictures to a lens with its accuracy, or to the reason for its failure."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from math import degrees, floor, hypot, radians
from typing import Final

import msgspec
import numpy as np

from fwav_companion.tools.calibrate.lens_fit.bundle_adjustment import camera_points, residuals
from fwav_companion.tools.calibrate.lens_fit.lens_accuracy import (
    WORST_RAY,
    Decentring,
    LensAccuracy,
    decentring,
    lens_accuracy,
    ray_sigmas,
)
from fwav_companion.tools.calibrate.lens_fit.outliers import FEWEST_CORNERS, DroppedView, consistent_views
from fwav_companion.tools.calibrate.lens_fit.polynomial_order import SelectedFit, select_order
from fwav_companion.tools.calibrate.lens_fit.reprojection import (
    ASPECT,
    RADIAL,
    U0,
    V0,
    BoardView,
    Floats,
    LensAndPoses,
    angles_from_axis,
    concatenated,
    radius,
    radius_slope,
)

FEWEST_VIEWS: Final = 5
"""Fewest views. A board gives two equations on a pinhole beyond its own pose (Zhang 2000), and a lens has five
parameters or more: this takes at least three boards, and two more to judge the others by."""
LEAST_TILT: Final = radians(10.0)
"""Least angle between the two most different boards: parallel boards leave the focal length free, in any number."""
MOST_NOISE_PX: Final = 2.0
"""Largest residual sigma of one axis, pixels. Corner detectors err by 0.05 to 0.5 px; beyond this limit the board is
not the one that was named, or not flat."""
LARGE_PX: Final = 1280
"""Longer side of a picture, pixels, beyond which the same blur is more pixels wide."""


class FitFailure(Enum):
    """Reason why the fit failed."""

    TOO_FEW_VIEWS = "too few pictures"
    SAME_TILT = "all boards are parallel"
    UNDETERMINED = "the pictures do not determine the lens"
    MISFIT = "no lens of this model fits"


class FailedFit(msgspec.Struct, frozen=True):
    """The result of a fit that gave no lens."""

    why: FitFailure
    """Kind of failure."""
    detail: str
    """What was found and what to do, one line."""
    dropped: tuple[DroppedView, ...] = ()
    """Pictures with a board that were not used."""


class FittedView(msgspec.Struct, frozen=True, eq=False):
    """A view that the fit uses."""

    view: BoardView
    """Corners, without the removed ones."""
    residuals: Floats
    """Observed minus projected pixels, (N, 2)."""
    angles: Floats
    """Angles of the corners from the optical axis, (N,), radians."""
    tilt: float
    """Angle between the board's normal and the line of sight, radians."""
    corners_out: int
    """Number of removed corners."""

    @property
    def rms_px(self) -> float:
        """Residual RMS of one axis, pixels."""
        return float(np.sqrt((self.residuals**2).mean()))


class FittedLens(msgspec.Struct, frozen=True, eq=False):
    """A lens, its accuracy, and the views it was fitted to."""

    image_size: tuple[int, int]
    """Width and height, pixels."""
    lens: Floats
    """u0, v0, aspect ratio, c1 .. cn (:mod:`fwav_companion.tools.calibrate.lens_fit.reprojection`)."""
    noise_px: float
    """One sigma of one axis of a corner, from the residuals and their degrees of freedom, pixels."""
    accuracy: LensAccuracy
    """Covariance, and the angles that corners reach and the fit supports."""
    decentring: Decentring
    """Displacement that the model leaves out."""
    largest_tilt: float
    """Largest angle between any two boards, radians."""
    views: tuple[FittedView, ...]
    """The views that the fit uses."""
    dropped: tuple[DroppedView, ...]
    """Pictures with a board that were not used."""

    @property
    def coefficients(self) -> int:
        """The number of coefficients of the radial polynomial."""
        return len(self.lens) - RADIAL

    @property
    def reprojection_rms_px(self) -> float:
        """The RMS length of a residual, pixels: the error that OpenCV's calibration reports."""
        squares = np.concatenate([(view.residuals**2).sum(axis=1) for view in self.views])
        return float(np.sqrt(squares.mean()))

    @property
    def enlargement(self) -> float:
        """The ratio of the picture's longer side to LARGE_PX, at least 1."""
        return max(1.0, max(self.image_size) / LARGE_PX)

    @property
    def image_angle(self) -> float | None:
        """The angle of the image's farthest corner, radians; None where the radius of the fit never reaches it."""
        width, height = self.image_size
        u, v = self.lens[U0], self.lens[V0]
        farthest = max(
            hypot(x - u, (y - v) / self.lens[ASPECT]) for x in (-0.5, width - 0.5) for y in (-0.5, height - 0.5)
        )
        grid = np.linspace(0.0, np.pi, 3601)
        falling = np.flatnonzero(radius_slope(self.lens, grid) <= 0.0)
        grid = grid[: falling[0]] if len(falling) else grid
        r = radius(self.lens, grid)
        return float(np.interp(farthest, r, grid)) if r[-1] >= farthest else None

    @property
    def valid_deg(self) -> float:
        """The camera file's max_angle_deg, degrees: where the fit or the image ends."""
        corner = self.image_angle
        end = self.accuracy.supported if corner is None else min(self.accuracy.supported, corner)
        return floor(100.0 * degrees(end)) / 100.0

    def sigma(self, index: int) -> float:
        """One sigma of a lens parameter, in its unit."""
        return float(np.sqrt(self.accuracy.covariance[index, index]))

    def ray_sigmas(self, angles: Floats) -> tuple[Floats, Floats]:
        """One sigma of rays at angles from the axis, radians: as they are, and without a common rotation."""
        return ray_sigmas(self.lens, self.accuracy.covariance, angles, self.accuracy.reached)


def fit_lens(views: Sequence[BoardView], image_size: tuple[int, int]) -> FittedLens | FailedFit:
    """The lens r = k1 theta + ... that projects the board's corners to where the pictures show them."""
    small = tuple(
        DroppedView(view.name, f"{len(view.pixels)} corners, {FEWEST_CORNERS} are needed", 0.0)
        for view in views
        if not _is_usable(view)
    )
    usable = [view for view in views if _is_usable(view)]
    if len(usable) < FEWEST_VIEWS:
        detail = f"the board is seen in {len(usable)}; at least {FEWEST_VIEWS} are needed, 15 are good"
        return FailedFit(FitFailure.TOO_FEW_VIEWS, detail, small)
    consistent = consistent_views(usable, image_size)
    dropped = small + consistent.dropped
    if len(consistent.views) < FEWEST_VIEWS:
        detail = f"of {len(usable)} with the board only {len(consistent.views)} agree with one lens; check --board"
        return FailedFit(FitFailure.TOO_FEW_VIEWS, detail, dropped)
    tilt = largest_tilt_between(consistent.state)
    if tilt < LEAST_TILT:
        detail = (
            f"no two of {len(consistent.views)} boards are tilted against each other by more than "
            f"{degrees(tilt):.0f}°; tilt the board by 30° to all sides"
        )
        return FailedFit(FitFailure.SAME_TILT, detail, dropped)
    selected = select_order(concatenated(consistent.views), consistent.state)
    fitted_views = _fitted_views(consistent.views, selected.state, consistent.corners_out)
    return _assessed(selected, fitted_views, dropped, image_size)


def largest_tilt_between(state: LensAndPoses) -> float:
    """The largest angle between two boards' normals in the camera frame, radians."""
    normals = state.rotations[:, :, 2]
    facing = normals * np.where((normals * state.positions).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    return float(np.arccos(np.clip((facing @ facing.T).min(), -1.0, 1.0)))


def _assessed(
    selected: SelectedFit, views: tuple[FittedView, ...], dropped: tuple[DroppedView, ...], size: tuple[int, int]
) -> FittedLens | FailedFit:
    """The lens with its accuracy, or the reason why these numbers are not a lens."""
    corners = concatenated([each.view for each in views])
    try:
        accuracy = lens_accuracy(corners, selected.state, selected.variance)
        variance = selected.variance * accuracy.inflation**2
        left_out = decentring(corners, selected.state, variance, accuracy.reached)
    except np.linalg.LinAlgError:
        return FailedFit(FitFailure.UNDETERMINED, "take pictures with other tilts and places of the board", dropped)
    fitted = FittedLens(
        image_size=size,
        lens=selected.state.lens,
        noise_px=selected.variance**0.5,
        accuracy=accuracy,
        decentring=left_out,
        largest_tilt=largest_tilt_between(selected.state),
        views=views,
        dropped=dropped,
    )
    misfit = _misfit(fitted)
    if misfit is not None:
        return FailedFit(FitFailure.MISFIT, misfit, dropped)
    undetermined = _undetermined(fitted)
    return fitted if undetermined is None else FailedFit(FitFailure.UNDETERMINED, undetermined, dropped)


def _fitted_views(
    views: Sequence[BoardView], state: LensAndPoses, corners_out: dict[str, int]
) -> tuple[FittedView, ...]:
    corners = concatenated(views)
    residual = residuals(corners, state)
    points = camera_points(corners, state)
    angles = angles_from_axis(points)
    sight = corners.by_view(points)
    facing = np.abs((state.rotations[:, :, 2] * sight).sum(axis=1)) / np.linalg.norm(sight, axis=1)
    tilts = np.arccos(np.clip(facing, 0.0, 1.0))
    of = [corners.view == i for i in range(len(views))]
    return tuple(
        FittedView(view, residual[mine], angles[mine], tilt=float(tilt), corners_out=corners_out.get(view.name, 0))
        for view, mine, tilt in zip(views, of, tilts, strict=True)
    )


def _is_usable(view: BoardView) -> bool:
    finite = np.isfinite(view.pixels).all() and np.isfinite(view.board).all()
    return len(view.pixels) >= FEWEST_CORNERS and bool(finite)


def _misfit(fitted: FittedLens) -> str | None:
    """Why the numbers of the fit do not describe a lens; None if they do."""
    lens = fitted.lens
    if not fitted.noise_px < MOST_NOISE_PX * fitted.enlargement:
        detail = f"the reprojection error is {fitted.noise_px:.1f} px an axis; corner detectors err by 0.1 to 0.5"
        return f"{detail}; check --board, that the board is flat, and that zoom and stabilisation are off"
    rising = (radius_slope(lens, np.linspace(0.0, fitted.accuracy.reached, 200)) > 0.0).all()
    if not (np.isfinite(lens).all() and lens[ASPECT] > 0.0 and rising):
        return "the radius of the best fit does not rise with the angle; check --board"
    return None


def _undetermined(fitted: FittedLens) -> str | None:
    """The parameters that the pictures do not determine well enough; None if they determine all."""
    lens, (width, height) = fitted.lens, fitted.image_size
    if not (-0.5 <= lens[U0] <= width - 0.5 and -0.5 <= lens[V0] <= height - 0.5):
        at = f"({lens[U0]:.0f} ± {fitted.sigma(U0):.0f}, {lens[V0]:.0f} ± {fitted.sigma(V0):.0f})"
        return f"the principal point is at {at}, outside the image; show the board on all sides, and tilted"
    half = 0.5 * fitted.accuracy.reached
    sigma = float(fitted.ray_sigmas(np.array([half]))[1][0])
    if not sigma < WORST_RAY:
        detail = f"one sigma of a ray {degrees(half):.0f}° off the axis is {degrees(sigma):.1f}°"
        return f"{detail}; show the board larger, nearer to the edges, and tilted by 30° to all sides"
    return None
