"""Accuracy of the centre of a model's box: a prior, or what `detect --sigma` has measured.

No publication gives figures for it: mAP hardly correlates with it (Zhang & Wang, arXiv 1611.06467). The prior is
half a pixel of the model's input and 3 % of the box's side: an intersection over union of 0.94 for a shift of one axis.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from fwav_companion.vision.detectors.model.boxes import Array, Flags

PRIOR: Final = (0.5, 0.03)
"""One sigma: pixels of the model's input, and share of the box's side."""
INT8_FACTOR: Final = 1.5
"""Factor for models that compute with 8-bit integers."""
DOUBTFUL_SCORE, DOUBTFUL_FACTOR = 0.5, 2.0
"""Boxes of a lower score, and the factor for them."""
CUT_PX: Final = 1.0
"""Distance from the picture's border at which the border cuts a box, pixels."""


def centre_sigmas(edges: Array, scores: Array, px_per_input: Array, model: tuple[float, float]) -> Array:
    """(N, 2) one sigma of the centres along u and v, pixels of the picture.

    ``edges``: (N, 4) in the picture. ``px_per_input``: (N) pixels of the picture per pixel of the model's input.
    ``model``: as :data:`PRIOR`.
    """
    floor_px, share = model
    sides = edges[:, 2:] - edges[:, :2]
    sigmas = np.hypot(floor_px * px_per_input[:, None], share * sides)
    sigmas *= np.where(scores < DOUBTFUL_SCORE, DOUBTFUL_FACTOR, 1.0)[:, None]
    return sigmas


def with_unknown_edges(sigmas: Array, edges: Array, cut: Flags) -> Array:
    """The sigmas, with those of boxes whose edge is unknown.

    ``cut``: (N, 4) flags of the edges that the picture or a tile cuts off. The thing may be any length there. Its
    centre is then uncertain by the longer side of what is seen: no bound exists, and this is wider than most things.
    """
    longest = np.max(edges[:, 2:] - edges[:, :2], axis=1)
    axes = cut[:, :2] | cut[:, 2:]  # (N, 2): left or right, top or bottom
    return np.where(axes, np.hypot(sigmas, longest[:, None]), sigmas)


def cut_by(edges: Array, width: int, height: int, margin_px: float = CUT_PX) -> Flags:
    """(N, 4) flags of the edges that lie on the border of a picture, in pixels of it."""
    low = edges[:, :2] <= -0.5 + margin_px
    high = edges[:, 2:] >= np.array([width, height]) - 0.5 - margin_px
    return np.concatenate([low, high], axis=1)
