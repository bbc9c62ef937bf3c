"""Sigma of a coloured blob's centre by its size and by the blur of its edge.

The values maximize the likelihood of the errors on 1400 rendered panels (sides of 6 to 110 px, turned, of several reds
on several grounds; moved by up to 0.9 of their side in any direction; lens blur and noise of the mock's camera). The
error of a sharp blob comes from the pixels of its edge, whose number is proportional to its side. The error of a moved
blob grows with the share of its area that is edge. It is the error of the middle of the coloured area: a target that
is only partly coloured or lit has another middle.
"""

from __future__ import annotations

from math import hypot, sqrt
from typing import Final

EDGE_PX: Final = 0.2465
"""One sigma of the centre of a sharp blob of one pixel; it falls with the root of the side."""
LENS_EDGE_PX: Final = 3.11
"""Share of a blob's area that is edge without motion, times its side: twice the width of the lens's blur."""
MOTION_PX, MOTION_POWER = 0.1913, 0.4387
"""One sigma of the centre of a blob that is all edge, and the exponent by which it grows with the share of the edge."""


def blob_sigma_px(area_px: float, edge_share: float) -> float:
    """One sigma of a blob's centre, each axis, pixels. ``edge_share``: share of its area with less than full colour."""
    side_px = sqrt(area_px)
    moved = max(0.0, edge_share - LENS_EDGE_PX / side_px)
    return hypot(EDGE_PX / sqrt(side_px), MOTION_PX * moved**MOTION_POWER)
