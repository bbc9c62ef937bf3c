"""How many coefficients the pictures support: as few as none of more would beat for a reason."""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np

from fwav_companion.tools.calibrate.lens_fit.adjustment import adjusted, camera_points, residuals
from fwav_companion.tools.calibrate.lens_fit.corners import Corners, State
from fwav_companion.tools.calibrate.lens_fit.information import widening
from fwav_companion.tools.calibrate.lens_fit.outliers import FINEST_PX, MOST_COEFFICIENTS
from fwav_companion.tools.calibrate.lens_fit.projection import RADIAL, angles_from_axis, powers, radius

GAIN: Final = 4.0
"""By which a coefficient that the lens does not have lowers the sum of squares, in variances, once in twenty times: the
square of a normal number. What is left out by it is under two sigmas of that coefficient; and over 60 draws of five
lenses the claim was as good as with 2 or 6."""


class Chosen(msgspec.Struct, frozen=True, eq=False):
    """The fit that is told."""

    state: State
    variance: float
    """Of one axis of a corner, pixels^2."""
    squares: tuple[float, ...]
    """The sum of squares with 1, 2, ... coefficients, pixels^2."""

    @property
    def coefficients(self) -> int:
        """How many."""
        return len(self.state.lens) - RADIAL


def chosen_fit(corners: Corners, state: State) -> Chosen:
    """Fits with one to five coefficients, and the first of them that no longer one beats."""
    weights = np.ones(len(corners.pixels))
    counts = range(1, MOST_COEFFICIENTS + 1)
    fits = [adjusted(corners, _shortened(corners, state, count), weights) for count in counts]
    squares = [float((residuals(corners, fit) ** 2).sum()) for fit in fits]
    believed = _believed_variance(corners, fits, squares)
    for index, fit in enumerate(fits):
        gains = [(squares[index] - more) / believed / extra for extra, more in enumerate(squares[index + 1 :], start=1)]
        if max(gains, default=0.0) < GAIN:
            return Chosen(fit, _variance(corners, fit, squares[index]), tuple(squares))
    raise AssertionError("the last has none that could beat it")


def _shortened(corners: Corners, state: State, count: int) -> State:
    """With so many coefficients, and a radius as near to the state's as they allow, at the corners' angles.

    Not from few coefficients to many: under a lens that is far off a board may flip, and it would stay so.
    """
    theta = angles_from_axis(camera_points(corners, state))
    odd, _ = powers(theta, count)
    fitted, *_ = np.linalg.lstsq(odd, radius(state.lens, theta))
    return State(np.concatenate([state.lens[:RADIAL], fitted]), state.turns, state.places)


def _believed_variance(corners: Corners, fits: list[State], squares: list[float]) -> float:
    """Of a corner, by the longest fit that is determined at all, widened by how the pictures disagree under it."""
    for fit, total in zip(reversed(fits), reversed(squares), strict=True):
        variance = _variance(corners, fit, total)
        try:
            return variance * widening(corners, fit, variance) ** 2
        except np.linalg.LinAlgError:
            continue
    return variance


def _variance(corners: Corners, fit: State, squares: float) -> float:
    """Of one axis of a corner, pixels^2."""
    freedom = 2 * len(corners.pixels) - 6 * len(corners.starts) - len(fit.lens)
    return max(FINEST_PX**2, squares / max(1, freedom))
