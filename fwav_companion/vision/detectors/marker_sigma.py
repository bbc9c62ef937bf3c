"""Sigma of a marker's centre by the size of its modules and by the blur of its edges.

The values maximize the likelihood of the errors on 7000 rendered markers (AprilTag 36h11, ArUco 4x4; sides of 18 to
140 px; turned and foreshortened; moved by up to 1.8 modules in any direction; lens blur and noise of the mock's
camera). Refined corners are accurate to some hundredths of a pixel until an edge is blurred over half a module: then
OpenCV's refinement loses the edge, and the error is a tenth of a module.
"""

from __future__ import annotations

from math import exp, log
from typing import Final

import numpy as np

MODULES_PX: Final = (2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 5.5, 6.0, 7.0, 8.5, 10.0, 14.0, 20.0)
"""Rows of the table: side of a module, pixels."""
WIDTHS: Final = (0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.8, 0.95)
"""Columns: width of the most blurred edge from black to white, in modules."""
SIGMAS_PX: Final = (
    (0.255, 0.166, 0.112, 0.083, 0.077, 0.104, 0.255, 0.420),
    (0.281, 0.214, 0.162, 0.128, 0.114, 0.153, 0.400, 0.415),
    (0.280, 0.258, 0.223, 0.186, 0.165, 0.247, 0.392, 0.418),
    (0.236, 0.264, 0.271, 0.206, 0.186, 0.335, 0.384, 0.477),
    (0.173, 0.188, 0.242, 0.175, 0.307, 0.365, 0.386, 0.432),
    (0.126, 0.092, 0.067, 0.187, 0.292, 0.265, 0.601, 0.498),
    (0.090, 0.074, 0.062, 0.038, 0.088, 0.312, 0.561, 0.532),
    (0.065, 0.060, 0.055, 0.059, 0.126, 0.343, 0.641, 0.516),
    (0.048, 0.066, 0.061, 0.155, 0.272, 0.508, 0.400, 0.604),
    (0.036, 0.048, 0.067, 0.064, 0.382, 0.474, 0.890, 0.599),
    (0.042, 0.043, 0.052, 0.156, 0.268, 0.765, 0.649, 0.684),
    (0.039, 0.042, 0.066, 0.141, 0.545, 1.049, 0.872, 1.057),
    (0.039, 0.061, 0.149, 0.759, 1.349, 0.925, 0.892, 1.400),
)
"""One sigma of a centre, each axis, pixels. Its logarithm is interpolated linearly in the logarithm of the module and
in the width. Small modules with sharp edges do not occur: the lens makes their edges wider."""
_ROWS, _LOGS = np.log(MODULES_PX), np.log(SIGMAS_PX)


def marker_sigma_px(module_px: float, width_px: float) -> float:
    """One sigma of the centre of a marker, each axis, pixels."""
    across = [float(np.interp(width_px / module_px, WIDTHS, row)) for row in _LOGS]
    return exp(float(np.interp(log(module_px), _ROWS, across)))
