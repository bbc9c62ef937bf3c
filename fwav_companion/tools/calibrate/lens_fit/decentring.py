"""What this model has no term for and lenses have: elements that are not centred on one axis.

    du = f (2 p1 x y + p2 (q + 2 x^2)),   dv = f (p1 (q + 2 y^2) + 2 p2 x y),   q = x^2 + y^2      (Brown 1966)

with x and y the pixel's offset from the principal point in focal lengths. The corners of good pictures show p1 and p2
though the file cannot hold them; so they are worked out once more beside the fit, to say how much it leaves out.
"""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np

from fwav_companion.tools.calibrate.lens_fit.adjustment import equations, jacobians
from fwav_companion.tools.calibrate.lens_fit.corners import Corners, Floats, State
from fwav_companion.tools.calibrate.lens_fit.information import inverse
from fwav_companion.tools.calibrate.lens_fit.projection import RADIAL, U0, radius

OUTWARDS: Final = 3.0
"""Times p q f: what decentring does to a pixel that lies in its direction."""


class Decentring(msgspec.Struct, frozen=True):
    """By how much pixels would move if the lens had these two numbers too."""

    edge_px: float
    """At the angle that corners reach, in the worst direction."""
    sigma_px: float


def decentring(corners: Corners, state: State, variance: float, reached: float) -> Decentring:
    """One step from the fit, its own numbers and all boards free. LinAlgError: the corners do not show it."""
    residual, by_board, by_lens = jacobians(corners, state)
    wider = np.concatenate([by_lens, _pattern(corners.pixels - residual, state.lens)], axis=-1)
    normal = equations(corners, residual, by_board, wider, np.ones(len(residual)))
    covariance = inverse(normal.per_view().sum(axis=0))
    p = (covariance @ normal.lens_pull.sum(axis=0))[-2:]
    focal = float(state.lens[RADIAL])
    edge = OUTWARDS * float(radius(state.lens, np.array(reached))) ** 2 / focal
    sigma = np.sqrt(variance * np.linalg.eigvalsh(covariance[-2:, -2:])[-1])
    return Decentring(edge * float(np.linalg.norm(p)), edge * float(sigma))


def _pattern(pixels: Floats, lens: Floats) -> Floats:
    """(M, 2, 2) of pixels by p1 and by p2."""
    focal = float(lens[RADIAL])
    x, y = ((pixels - lens[U0 : U0 + 2]) / focal).T
    q = x * x + y * y
    by_p1, by_p2 = np.stack([2.0 * x * y, q + 2.0 * y * y], axis=1), np.stack([q + 2.0 * x * x, 2.0 * x * y], axis=1)
    pattern: Floats = focal * np.stack([by_p1, by_p2], axis=-1)
    return pattern
