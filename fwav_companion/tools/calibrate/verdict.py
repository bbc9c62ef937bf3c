"""What a fit is good for: where it is thin, said with what to do about it, and what the configuration should have."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, degrees, radians
from typing import Final

import numpy as np

from fwav_companion.tools.calibrate.lens_fit.fit import Fitted, image_angle
from fwav_companion.tools.calibrate.lens_fit.projection import STRETCH

PARTS: Final = (8, 6)
"""Across and down: the image in parts, each with a corner or without."""
GOOD_SHARE: Final = 0.7
"""Of the parts that the lens sees: the image's own corners are hard to reach with a board."""
GOOD_REACH: Final = 0.85
"""Of the angle of the image's farthest corner."""
GOOD_VIEWS: Final = 10
"""With fewer, what one picture has wrong is a tenth of the answer or more."""
GOOD_TILT: Final = radians(25.0)
"""Between two boards: at 25 degrees a square is a tenth shorter than face on, which is what shows the focal length."""
ROUGH_PX: Final = 0.7
"""Finders err by 0.05 to 0.5 px."""
DISAGREE: Final = 2.0
SQUARE: Final = 0.004
"""Pixels are square to a thousandth or two; a print that a printer scaled in one direction is not."""
SURE: Final = 4.0
"""Sigmas."""


def covered(fitted: Fitted) -> tuple[int, int]:
    """Of the image's parts those with a corner, and those that the lens sees."""
    width, height = fitted.image_size
    pixels = np.concatenate([seen.view.pixels for seen in fitted.seen])
    cells = np.clip((pixels + 0.5) / (width, height) * PARTS, 0, np.array(PARTS) - 1).astype(int)
    occupied = {(int(i), int(j)) for i, j in cells}
    i, j = np.meshgrid(np.arange(PARTS[0]), np.arange(PARTS[1]))
    u, v = (i + 0.5) * width / PARTS[0] - 0.5, (j + 0.5) * height / PARTS[1] - 0.5
    r = np.hypot(u - fitted.lens[0], (v - fitted.lens[1]) / fitted.lens[STRETCH])
    reach = max(float(np.hypot(*(pixel - fitted.lens[:2]))) for pixel in pixels)
    whole = image_angle(fitted) is not None
    seen = {(int(a), int(b)) for a, b in zip(i[whole | (r <= reach)], j[whole | (r <= reach)], strict=True)}
    return len(occupied), len(seen | occupied)


def notes(fitted: Fitted) -> Iterator[str]:
    """What is thin, and what to do."""
    yield from _coverage(fitted)
    if len(fitted.seen) < GOOD_VIEWS:
        yield f"{len(fitted.seen)} pictures: 15 to 30 from all sides average out what one alone has wrong"
    if fitted.tilted < GOOD_TILT:
        told = f"no two boards are tilted against each other by more than {degrees(fitted.tilted):.0f}°"
        yield f"{told}: tilt it by 30° to 45° to all sides"
    if fitted.noise_px > ROUGH_PX * fitted.blown_up:
        yield f"corners miss by {fitted.noise_px:.1f} px, in good pictures by 0.1 to 0.3: blur, a bent board?"
    if fitted.claim.disagreement > DISAGREE:
        yield (
            f"pictures disagree by {fitted.claim.disagreement:.1f} times what their corners scatter, and every sigma "
            "is that much wider: hold still, glue the board onto something flat"
        )
    edge_px, sigma_px = fitted.decentring.edge_px, fitted.decentring.sigma_px
    if edge_px > SURE * sigma_px:
        at = f"by {edge_px:.1f} ± {sigma_px:.1f} px at {degrees(fitted.claim.reached):.0f}°"
        yield f"the lens is not centred on one axis, {at}: this model has no term for it, and no sigma here contains it"
    stretch, sigma = fitted.lens[STRETCH], fitted.sigma(STRETCH)
    if abs(stretch - 1.0) > SQUARE + SURE * sigma:
        yield f"pixels come out {100.0 * abs(stretch - 1.0):.1f} % off square: measure the print along both its sides"


def _coverage(fitted: Fitted) -> Iterator[str]:
    corner, reached, limit = image_angle(fitted), fitted.claim.reached, fitted.claim.supported
    if corner is not None and reached < GOOD_REACH * corner:
        ends = (
            f"rays beyond {degrees(limit):.0f}° will be refused"
            if limit < corner
            else "what lies beyond is continued from there"
        )
        yield (
            f"corners reach {degrees(reached):.0f}° of the image's {degrees(corner):.0f}° from the axis, and {ends}: "
            "show the board at the image's edges and corners too"
        )
    with_corners, parts = covered(fitted)
    if with_corners < GOOD_SHARE * parts:
        yield f"corners lie in {with_corners} of {parts} parts of the image: show the board in the others too"


def least_pixel_noise_px(fitted: Fitted) -> float:
    """For [uncertainty] pixel_noise_px: what a finder of sharp corners leaves, up to a tenth."""
    return ceil(10.0 * fitted.noise_px) / 10.0


def least_mount_bias_deg(fitted: Fitted) -> float:
    """For [uncertainty] mount_bias_deg: one sigma of the worst ray, which is off alike all through a flight."""
    total, _ = fitted.ray_sigmas(np.linspace(0.0, fitted.claim.reached, 9))
    return ceil(100.0 * degrees(float(total.max()))) / 100.0
