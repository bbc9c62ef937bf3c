"""The delay, coarsely, and how the camera sits, without believing anything of either beforehand.

Between two frames the tag turns in the camera as the body turns by the autopilot's attitude, seen from other axes:

    turn in the camera = camera_from_body * turn of the body

So whatever the delay, the best orthogonal matrix between the two (Kabsch) says how well they belong together. The best
delay is where they do best, and the matrix there shows reversed and exchanged axes as they are.
"""

from __future__ import annotations

from typing import Final, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from fwav_companion.tools.shake.looks import Course
from fwav_companion.tools.shake.turns import Flags, Floats, log, transposed

Indexes: TypeAlias = NDArray[np.intp]

EARLIEST_S: Final = -0.2
LATEST_S: Final = 0.5
"""Delays that are tried: a frame that came half a second after its capture would be refused as too late."""
STEP_S: Final = 0.005
"""A twentieth of the fastest wing beat's quarter: the refinement finds the rest."""
LEAST_APART_S: Final = 0.08
MOST_APART_S: Final = 0.25
"""Of two frames that are compared: far enough that a hand has turned by more than a corner's noise."""
LEAST_PAIRS: Final = 30
"""A second of frames."""
RIVAL_APART_S: Final = 0.06
"""Delays nearer to one another than this belong to the same peak."""

SURE: Final = 5.0
"""Sigmas by which the weakest axis must show before it may call itself reversed."""
OF_ITS_OWN: Final = 0.3
"""Of the next weaker axis's turns. Rolling and pitching alone turn the body about its third axis too, by the sine of
their angles; and there a reversed pitch cannot be told from a mirrored image, whatever the noise."""


class FirstLook(msgspec.Struct, frozen=True):
    """What the turns alone say."""

    delay_s: float
    likeness: float
    """How alike the turns are there: 1 the same but for the axes, 0 strangers."""
    rival: float
    """The same at the best delay that is none of this peak's: regular shaking fits itself a beat later, too."""
    camera_from_body: Floats
    """(3, 3) orthogonal; its determinant is -1 where an axis of the two is reversed against the other."""
    handed: bool
    """All three axes were turned about enough that the determinant's sign is sure."""
    weakest: Floats
    """(3,) the body's axis that was turned about least."""
    turned: Floats
    """(3,) by how much the body turned about each axis between two frames, RMS, radians."""


def first_look(times_s: Floats, camera_from_tag: Floats, course: Course) -> FirstLook | None:
    """None where no two frames can be compared.

    ``times_s``: (N,) when each frame was taken by its stamp. ``camera_from_tag``: (N, 3, 3) by its corners.
    """
    first, second = _pairs(times_s)
    if len(first) < LEAST_PAIRS:
        return None
    seen = log(camera_from_tag[first] @ transposed(camera_from_tag[second]))
    delays_s = np.arange(EARLIEST_S, LATEST_S + STEP_S / 2.0, STEP_S)
    told = _told_turns(times_s, first, second, delays_s, course)
    scored = [_likeness(seen, *at) for at in told]
    scores = np.array([score for score, _ in scored])
    best = int(scores.argmax())
    if scores[best] <= 0.0:
        return None
    apart = np.abs(delays_s - delays_s[best]) > RIVAL_APART_S
    turns, known = told[best]
    seen, turns = seen[known], turns[known]
    orthogonal, handed, weakest = _orthogonal(scored[best][1], seen, turns)
    return FirstLook(
        delay_s=float(delays_s[best]),
        likeness=float(scores[best]),
        rival=float(scores[apart].max()),
        camera_from_body=orthogonal,
        handed=handed,
        weakest=weakest,
        turned=np.sqrt((turns**2).mean(axis=0)),
    )


def _pairs(times_s: Floats) -> tuple[Indexes, Indexes]:
    """Indexes of frames and of the next one that is far enough from each."""
    second = np.searchsorted(times_s, times_s + LEAST_APART_S)
    first = np.flatnonzero(second < len(times_s))
    second = second[first]
    near = times_s[second] - times_s[first] <= MOST_APART_S
    return first[near], second[near]


def _told_turns(
    times_s: Floats, first: Indexes, second: Indexes, delays_s: Floats, course: Course
) -> list[tuple[Floats, Flags]]:
    """By delay: (P, 3) turns of the body over the same pairs, and (P,) whether they are known."""
    begin_s = times_s[0] - LATEST_S
    grid_s = np.arange(begin_s, times_s[-1] - EARLIEST_S + STEP_S, STEP_S)
    ned_from_body, known = course.at(grid_s)
    told = []
    for delay_s in delays_s:
        at = np.clip(np.rint((times_s - delay_s - begin_s) / STEP_S).astype(int), 0, len(grid_s) - 1)
        body, sure = ned_from_body[at], known[at]
        told.append((log(transposed(body[first]) @ body[second]), sure[first] & sure[second]))
    return told


def _likeness(seen: Floats, told: Floats, known: Flags) -> tuple[float, Floats]:
    """How well the best orthogonal matrix carries the told turns into the seen ones, and their correlation."""
    seen, told = seen[known], told[known]
    if len(seen) < len(known) / 2:
        return 0.0, np.zeros((3, 3))
    correlation = seen.T @ told
    most = np.sqrt((seen**2).sum() * (told**2).sum())
    return float(np.linalg.svd(correlation, compute_uv=False).sum() / max(most, 1e-12)), correlation


def _orthogonal(correlation: Floats, seen: Floats, told: Floats) -> tuple[Floats, bool, Floats]:
    """The best matrix, proper unless its weakest axis says otherwise beyond doubt; whether it can say so; that axis."""
    u, _, vt = np.linalg.svd(correlation)
    free = u @ vt
    noise = np.sqrt(((seen - told @ free.T) ** 2).mean())
    _, weaker, weakest = np.sqrt(((told @ vt.T) ** 2).sum(axis=0))
    handed = bool(weakest > SURE * noise and weakest > OF_ITS_OWN * weaker)
    if np.linalg.det(free) > 0.0 or handed:
        return free, handed, vt[2]
    return u @ np.diag([1.0, 1.0, -1.0]) @ vt, handed, vt[2]
