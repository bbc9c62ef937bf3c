"""Sigma of a marker's centre by the size of its modules and by how far its edges are blurred.

Measured on 5000 rendered markers (AprilTag 36h11, ArUco 4x4; sides of 18 to 140 px; turned and foreshortened; moved by
up to 1.8 modules in any direction; lens blur and noise of the mock's camera), as the maximum of the likelihood of their
errors. Refined corners are accurate to some hundredths of a pixel until an edge is blurred over half a module: then
OpenCV's refinement loses it, and the error is a tenth of a module.
"""

from __future__ import annotations

from math import exp, log
from typing import Final

import numpy as np

MODULES_PX: Final = (2.5, 3.5, 5.0, 7.0, 10.0, 14.0, 20.0)
"""Rows of the table: side of a module, pixels."""
WIDTHS: Final = (0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.8, 0.95)
"""Columns: width of the most blurred edge from black to white, in modules."""
SIGMAS_PX: Final = (
    (0.100, 0.150, 0.200, 0.160, 0.100, 0.095, 0.279, 0.422),
    (0.060, 0.079, 0.130, 0.234, 0.176, 0.249, 0.405, 0.413),
    (0.043, 0.048, 0.042, 0.175, 0.255, 0.345, 0.510, 0.503),
    (0.035, 0.060, 0.064, 0.087, 0.264, 0.419, 0.533, 0.591),
    (0.040, 0.043, 0.056, 0.121, 0.328, 0.689, 0.797, 0.684),
    (0.038, 0.045, 0.063, 0.158, 0.543, 0.947, 0.815, 0.924),
    (0.040, 0.062, 0.157, 0.796, 1.391, 0.978, 0.992, 1.200),
)
"""One sigma of a centre, each axis, pixels. Between rows and columns its logarithm is linear, by the logarithm of the
module and by the width. Small modules with sharp edges do not occur: their edges are wider than that by the lens."""
_ROWS, _LOGS = np.log(MODULES_PX), np.log(SIGMAS_PX)


def marker_sigma_px(module_px: float, width_px: float) -> float:
    """One sigma of the centre of a marker, each axis, pixels."""
    across = [float(np.interp(width_px / module_px, WIDTHS, row)) for row in _LOGS]
    return exp(float(np.interp(log(module_px), _ROWS, across)))
