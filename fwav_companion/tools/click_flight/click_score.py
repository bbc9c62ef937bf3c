"""Comparison of a clicked spot's detections with the mock's truth. PURE."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from math import hypot
from typing import Any, Final

import msgspec

from fwav_companion.geometry.ellipses import circle_radius

EDGE_PX: Final = 40.0
"""Distance from the picture's edge within which the spot's patch is not whole, pixels."""
SHARP_PX: Final = 2.0
"""Largest motion of a sharp picture during its exposure, pixels."""
PASS_GAP_S: Final = 1.0
"""Shortest absence between two passes: the flapping takes a spot out of the picture for a tenth of a second."""
LEAST_FOUND: Final = 0.8
"""Share of the frames with the sharp spot in which it must be found: 95 % over many flights, and one has few frames."""
ANOTHER_THING_M: Final = 0.5
"""Ground distance from which a detection belongs to another object, metres: three times the 95 % error."""


class SpotSample(msgspec.Struct, frozen=True):
    """One frame that truly shows the spot, after the click."""

    frame: int
    at_s: float
    found_px: tuple[float, float] | None
    sharp: bool
    error_px: float | None
    error_m: float | None
    """Error on the ground due to the pixel's error, metres."""


class ClickScore(msgspec.Struct, frozen=True, kw_only=True):
    """The result of one flight."""

    samples: tuple[SpotSample, ...] = ()
    refusals: tuple[str, ...] = ()
    """Why earlier clicks were refused."""
    confirmed: bool = False
    error_m: float | None = None
    """Distance of the target from the spot on the map at the end."""
    claimed95_m: float | None = None
    """95 % radius that the service claims, metres."""
    troubles: tuple[str, ...] = ()
    """Reasons for exit status 1; empty: success."""

    @property
    def sharp(self) -> int:
        """Frames that show the spot sharply."""
        return sum(each.sharp for each in self.samples)

    @property
    def sharp_found(self) -> int:
        """Frames that show the spot sharply and in which it was found."""
        return sum(each.sharp and each.found_px is not None for each in self.samples)

    @property
    def added95_m(self) -> float | None:
        """Ground error that the tracker adds at most in 95 % of the frames in which it finds the spot, metres."""
        errors = sorted(each.error_m for each in self.samples if each.error_m is not None)
        return errors[round(0.95 * (len(errors) - 1))] if errors else None

    @property
    def passes(self) -> int:
        """Number of times that the spot came into the picture, including the first."""
        times = [each.at_s for each in self.samples]
        return sum(after - before > PASS_GAP_S for before, after in pairwise(times)) + bool(times)

    def as_json(self) -> dict[str, Any]:
        """The object that ``--json`` prints."""
        return {
            "ok": not self.troubles,
            "frames": len(self.samples),
            "sharp": self.sharp,
            "sharp_found": self.sharp_found,
            "passes": self.passes,
            "added95_m": self.added95_m,
            "error_m": self.error_m,
            "claimed95_m": self.claimed95_m,
            "refused_clicks": list(self.refusals),
            "troubles": list(self.troubles),
        }


def sample(frame: int, *, at_s: float, true: Sequence[float], blur_px: float, scale: float, found: Any) -> SpotSample:
    """The sample of a frame. ``scale``: metres a pixel. ``found``: the pixel at which the spot was found, or None."""
    error_px = None if found is None else hypot(found[0] - true[0], found[1] - true[1])
    return SpotSample(
        frame=frame,
        at_s=at_s,
        found_px=found,
        sharp=blur_px < SHARP_PX,
        error_px=error_px,
        error_m=None if error_px is None else error_px * scale,
    )


def is_whole(pixel: Sequence[float], size: tuple[int, int]) -> bool:
    """Whether the spot's patch is completely in the picture."""
    u, v = pixel
    return EDGE_PX < u < size[0] - 1 - EDGE_PX and EDGE_PX < v < size[1] - 1 - EDGE_PX


def with_troubles(score: ClickScore, cov: Any, *, right_picture: bool, strays: Iterable[int]) -> ClickScore:
    """The score with its troubles. ``cov``: of the target at the end. ``strays``: frames in which the spot was found
    although it was not in the picture.
    """
    troubles = []
    if not right_picture:
        troubles.append("the click was taken for another picture than the one on the screen")
    if not score.confirmed:
        troubles.append("the click never became a confirmed target")
    if score.sharp_found < LEAST_FOUND * score.sharp:
        troubles.append(f"the spot was found in {score.sharp_found} of the {score.sharp} frames that show it sharply")
    wrong = [each.frame for each in score.samples if each.error_m is not None and each.error_m > ANOTHER_THING_M]
    wrong += strays
    if wrong:
        troubles.append(f"another thing was taken for the spot in frame {min(wrong)}")
    if score.error_m is not None and score.error_m > circle_radius(cov, 0.999):
        troubles.append(f"its place is wrong by {score.error_m:.2f} m, more than the service claims with 99.9 %")
    return msgspec.structs.replace(score, troubles=tuple(troubles))
