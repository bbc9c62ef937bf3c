"""From the corners in the pictures to a lens with its claim, or the reason why not."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from math import degrees, hypot, radians
from typing import Final

import msgspec
import numpy as np

from fwav_companion.tools.calibrate.lens_fit.adjustment import camera_points, residuals
from fwav_companion.tools.calibrate.lens_fit.choice import Chosen, chosen_fit
from fwav_companion.tools.calibrate.lens_fit.claims import WORST_RAY, Claim, claim, ray_sigmas
from fwav_companion.tools.calibrate.lens_fit.corners import Floats, State, View, gather
from fwav_companion.tools.calibrate.lens_fit.decentring import Decentring, decentring
from fwav_companion.tools.calibrate.lens_fit.outliers import FEWEST_CORNERS, Dropped, sound_views
from fwav_companion.tools.calibrate.lens_fit.projection import RADIAL, STRETCH, U0, V0, angles_from_axis, radius, slope

FEWEST_VIEWS: Final = 5
"""Beside its own place the straight image of a board gives two equations (Zhang 2000), and a lens has five numbers or
more: three boards at the least, and two more for the others to be judged by."""
LEAST_TILT: Final = radians(10.0)
"""Between the two most unlike of all boards. Parallel boards leave the focal length open, however many they are."""
MOST_NOISE_PX: Final = 2.0
"""Finders of corners err by 0.05 to 0.5 px. Beyond this the board is not what was said, or not flat."""
LARGE_PX: Final = 1280
"""The longer side of a picture, beyond which the same blur is more pixels wide."""


class WhyNot(Enum):
    """Why there is no lens."""

    TOO_FEW_VIEWS = "too few pictures"
    SAME_TILT = "all boards are parallel"
    UNDETERMINED = "the pictures leave the lens open"
    MISFIT = "no lens of this model fits"


class Unfitted(msgspec.Struct, frozen=True):
    """No lens."""

    why: WhyNot
    told: str
    """One line: what was seen, what is wanted."""
    dropped: tuple[Dropped, ...] = ()


class Seen(msgspec.Struct, frozen=True, eq=False):
    """A view that the fit rests on."""

    view: View
    """Without the corners that were thrown out."""
    residuals: Floats
    """(N, 2) pixels, seen less fitted."""
    angles: Floats
    """(N,) from the optical axis, radians."""
    tilt: float
    """Of the board against one that is seen face on, radians."""
    corners_out: int

    @property
    def rms_px(self) -> float:
        """Of one axis."""
        return float(np.sqrt((self.residuals**2).mean()))


class Fitted(msgspec.Struct, frozen=True, eq=False):
    """A lens, and how good it is."""

    image_size: tuple[int, int]
    lens: Floats
    """u0, v0, the stretch of v, c1 .. cn: :mod:`fwav_companion.tools.calibrate.lens_fit.projection`."""
    noise_px: float
    """One sigma of a corner's axis, by the residuals."""
    claim: Claim
    decentring: Decentring
    """What the model leaves out."""
    tilted: float
    """The largest angle between any two boards, radians."""
    seen: tuple[Seen, ...]
    dropped: tuple[Dropped, ...]

    @property
    def coefficients(self) -> int:
        """Of the radial polynomial."""
        return len(self.lens) - RADIAL

    @property
    def blown_up(self) -> float:
        """How many times more pixels than a picture of LARGE_PX this one has along a side; 1 where it is smaller."""
        return max(1.0, max(self.image_size) / LARGE_PX)

    def sigma(self, index: int) -> float:
        """Of one of the lens's numbers, in its unit."""
        return float(np.sqrt(self.claim.covariance[index, index]))

    def ray_sigmas(self, angles: Floats) -> tuple[Floats, Floats]:
        """One sigma of rays at angles from the axis, radians: as they are, and a common turn aside."""
        return ray_sigmas(self.lens, self.claim.covariance, angles, self.claim.reached)


def fit_lens(views: Sequence[View], image_size: tuple[int, int]) -> Fitted | Unfitted:
    """The lens with r = k1 theta + ... that shows the board's corners where the pictures do."""
    small = tuple(
        Dropped(view.name, f"{len(view.pixels)} corners are too few", 0.0) for view in views if not _is_usable(view)
    )
    usable = [view for view in views if _is_usable(view)]
    if len(usable) < FEWEST_VIEWS:
        told = f"the board is seen in {len(usable)} of them; {FEWEST_VIEWS} is the least, 15 are good"
        return Unfitted(WhyNot.TOO_FEW_VIEWS, told, small)
    sound = sound_views(usable, image_size)
    dropped = small + sound.dropped
    if len(sound.views) < FEWEST_VIEWS:
        told = f"of {len(usable)} that show the board only {len(sound.views)} agree with one lens; is --board right?"
        return Unfitted(WhyNot.TOO_FEW_VIEWS, told, dropped)
    spread = largest_tilt_between(sound.state)
    if spread < LEAST_TILT:
        told = (
            f"no two of {len(sound.views)} boards are tilted against each other by more than {degrees(spread):.0f}°; "
            "tilt it by 30° to all sides"
        )
        return Unfitted(WhyNot.SAME_TILT, told, dropped)
    return _fitted(sound.views, sound.state, sound.corners_out, dropped, image_size)


def largest_tilt_between(state: State) -> float:
    """The largest angle between two boards' normals, as the camera sees them, radians."""
    normals = state.turns[:, :, 2]
    facing = normals * np.where((normals * state.places).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    return float(np.arccos(np.clip((facing @ facing.T).min(), -1.0, 1.0)))


def _fitted(
    views: Sequence[View], state: State, out: dict[str, int], dropped: tuple[Dropped, ...], size: tuple[int, int]
) -> Fitted | Unfitted:
    corners = gather(views)
    chosen = chosen_fit(corners, state)
    try:
        claimed = claim(corners, chosen)
        left_out = decentring(corners, chosen.state, chosen.variance * claimed.disagreement**2, claimed.reached)
    except np.linalg.LinAlgError:
        return Unfitted(WhyNot.UNDETERMINED, "other tilts and places of the board are wanted", dropped)
    seen = _seen(views, chosen, out)
    tilted = largest_tilt_between(chosen.state)
    fitted = Fitted(size, chosen.state.lens, chosen.variance**0.5, claimed, left_out, tilted, seen, dropped)
    misfit = _misfit(fitted)
    if misfit is not None:
        return Unfitted(WhyNot.MISFIT, misfit, dropped)
    trouble = _left_open(fitted)
    return fitted if trouble is None else Unfitted(WhyNot.UNDETERMINED, trouble, dropped)


def _seen(views: Sequence[View], chosen: Chosen, out: dict[str, int]) -> tuple[Seen, ...]:
    corners = gather(views)
    residual = residuals(corners, chosen.state)
    points = camera_points(corners, chosen.state)
    angles = angles_from_axis(points)
    middles = corners.by_view(points)
    across = np.abs((chosen.state.turns[:, :, 2] * middles).sum(axis=1)) / np.linalg.norm(middles, axis=1)
    tilts = np.arccos(np.clip(across, 0.0, 1.0))
    of = [corners.view == i for i in range(len(views))]
    return tuple(
        Seen(view, residual[mine], angles[mine], float(tilt), out.get(view.name, 0))
        for view, mine, tilt in zip(views, of, tilts, strict=True)
    )


def _is_usable(view: View) -> bool:
    finite = np.isfinite(view.pixels).all() and np.isfinite(view.board).all()
    return len(view.pixels) >= FEWEST_CORNERS and bool(finite)


def _misfit(fitted: Fitted) -> str | None:
    """What makes the answer no lens."""
    lens = fitted.lens
    if not fitted.noise_px < MOST_NOISE_PX * fitted.blown_up:
        told = f"the corners miss by {fitted.noise_px:.1f} px, where finders err by 0.1 to 0.5"
        return f"{told}; is --board right, the board flat, the lens one without zoom or stabilisation?"
    rising = (slope(lens, np.linspace(0.0, fitted.claim.reached, 200)) > 0.0).all()
    if not (np.isfinite(lens).all() and lens[STRETCH] > 0.0 and rising):
        return "the radius of the best fit does not rise with the angle; is --board right?"
    return None


def _left_open(fitted: Fitted) -> str | None:
    """What the pictures do not show well enough."""
    lens, (width, height) = fitted.lens, fitted.image_size
    if not (-0.5 <= lens[U0] <= width - 0.5 and -0.5 <= lens[V0] <= height - 0.5):
        middle = f"({lens[U0]:.0f} ± {fitted.sigma(U0):.0f}, {lens[V0]:.0f} ± {fitted.sigma(V0):.0f})"
        return f"the principal point would lie at {middle}, outside the image; show the board on all sides, and tilted"
    half = 0.5 * fitted.claim.reached
    sigma = float(fitted.ray_sigmas(np.array([half]))[1][0])
    if not sigma < WORST_RAY:
        told = f"one sigma of a ray {degrees(half):.0f}° off the axis would be {degrees(sigma):.1f}°"
        return f"{told}; show the board larger, nearer to the edges, and tilted by 30° to all sides"
    return None


def image_angle(fitted: Fitted) -> float | None:
    """The angle of the image's farthest corner under the fit, radians; None where its radius never gets there."""
    width, height = fitted.image_size
    u, v = fitted.lens[U0], fitted.lens[V0]
    farthest = max(
        hypot(x - u, (y - v) / fitted.lens[STRETCH]) for x in (-0.5, width - 0.5) for y in (-0.5, height - 0.5)
    )
    grid = np.linspace(0.0, np.pi, 3601)
    falling = np.flatnonzero(slope(fitted.lens, grid) <= 0.0)
    grid = grid[: falling[0]] if len(falling) else grid
    r = radius(fitted.lens, grid)
    return float(np.interp(farthest, r, grid)) if r[-1] >= farthest else None
