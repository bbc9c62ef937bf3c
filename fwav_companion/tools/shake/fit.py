"""Delay and mount by least squares on the corners' pixels, with sigmas that believe the residuals and not the noise."""

from __future__ import annotations

from math import radians
from typing import Final

import msgspec
import numpy as np

from fwav_companion.tools.shake.looks import Course, Looks
from fwav_companion.tools.shake.misses import (
    DELAY,
    FREE_PER_FRAME,
    HEADINGS,
    MOUNT,
    READOUT,
    SLOPE,
    Estimate,
    Misses,
    Poses,
    SeenTag,
)
from fwav_companion.tools.shake.turns import Floats, transposed

HEADING_STEP: Final = radians(1.0)
"""One sigma by which heading may drift from knot to knot: what compasses do when they are turned by hand indoors."""
LEVEL: Final = radians(0.5)
"""One sigma of the slope of what people call level: 9 mm on a metre."""
STEPS: Final = 30
"""A rolling shutter, whose rows the hand's own speed moves, takes a dozen."""
SETTLED: Final = 0.02
"""A step of so many sigmas changes nothing."""
FIRST_NOISE_PX: Final = 0.3
"""Of a corner, until the residuals tell."""
DAMPED: Final = 4.0
"""Frames that miss by more than so many sigmas count for less and less (Cauchy): a corner on a finger, a blur."""
MEMORY_S: Final = 0.5
"""Errors of corners hang together over so long: they come of how the tag lies in the image."""
AT_ONCE: Final = 256
"""Frames that are compared with those near them."""
MEDIAN_OF_CHI2: Final = 4.35
"""Of five degrees of freedom."""
ROLLED: Final = 1.25
"""Behind a rolling shutter the speeds tie frames together: over 60 sessions the mount's yaw erred by so much more than
the residuals claim."""


class Start(msgspec.Struct, frozen=True):
    """Where the search begins, and what is known beforehand."""

    delay_s: float
    camera_from_body: Floats
    """(3, 3) a rotation."""
    readout_s: float
    readout_sigma_s: float
    """0: it is known."""
    attitude_noise: float
    """One sigma of each attitude about each axis, radians."""


class Fit(msgspec.Struct, frozen=True):
    """What the corners say."""

    delay_s: float
    body_from_camera: Floats
    """(3, 3)."""
    readout_s: float
    sigmas: Floats
    """Of the delay in seconds, then of the mount about each body axis in radians."""
    pixel_sigma: float
    """Of a corner, an axis, as it turned out."""
    frames: int
    """That were used."""


def fit(looks: Looks, course: Course, start: Start, tag_size_m: float) -> Fit | None:
    """None where nothing is left to fit, or it does not come to rest."""
    tag = SeenTag(looks, course, tag_size_m)
    poses = tag.poses(start.delay_s, start.readout_s)
    if poses is None:
        return None
    search = _Search(tag, start, poses)
    for _ in range(STEPS):
        if not search.step():
            return None
        if search.rest < SETTLED:
            return search.answer()
    return None


class _Search:
    """The estimate on its way, and how far off it is."""

    def __init__(self, tag: SeenTag, start: Start, poses: Poses) -> None:
        """``poses``: by the delay and readout of the start."""
        self._tag, self._start, self._poses = tag, start, poses
        headings = np.full(tag.knots, tag.heading(start.camera_from_body, poses))
        self._estimate = Estimate(start.delay_s, start.camera_from_body, start.readout_s, np.zeros(2), headings)
        self._noise2 = FIRST_NOISE_PX**2
        self.rest = np.inf
        """Of the last step, in sigmas."""
        self._look()

    def step(self) -> bool:
        """Gauss and Newton, and a look from there; False where it leaps out of reach, or attitudes are missing."""
        normal, right = self._normal()
        prior, prior_right = self._prior()
        step = -np.linalg.solve(normal + prior, right + prior_right).astype(np.float64)
        if not np.isfinite(step).all() or abs(step[DELAY]) > 0.2 or np.linalg.norm(step[MOUNT]) > 1.0:
            return False
        self.rest = float(np.abs(step * np.sqrt(np.diag(normal + prior)))[:READOUT].max())
        self._estimate = self._estimate.stepped(step)
        poses = self._tag.poses(self._estimate.delay_s, self._estimate.readout_s)
        if poses is None:
            return False
        self._poses = poses
        self._look()
        return True

    def answer(self) -> Fit:
        """The estimate as it stands."""
        return Fit(
            delay_s=self._estimate.delay_s,
            body_from_camera=self._estimate.camera_from_body.T,
            readout_s=self._estimate.readout_s,
            sigmas=self._sigmas(),
            pixel_sigma=float(np.sqrt(self._noise2)),
            frames=int(self._poses.used.sum()),
        )

    def _look(self) -> None:
        self._whiten(self._tag.misses(self._estimate, self._poses))
        self._weigh()

    def _whiten(self, misses: Misses) -> None:
        """Without what each frame's place takes up, and in units of a corner's noise once its attitude's is counted."""
        by_attitude = misses.jacobian[:, :, MOUNT] * (self._start.attitude_noise / np.sqrt(self._noise2))
        scale = np.linalg.cholesky(np.eye(8) + by_attitude @ transposed(by_attitude))
        own, _ = np.linalg.qr(np.linalg.solve(scale, misses.by_place))
        both = np.linalg.solve(scale, np.concatenate([misses.residual[..., None], misses.jacobian], axis=2))
        both = both - own @ (transposed(own) @ both)
        self._residual, self._jacobian = both[..., 0], both[..., 1:]

    def _weigh(self) -> None:
        """The corners' noise by the median frame, and each frame's weight by its own."""
        used = self._poses.used
        square = np.where(used, (self._residual**2).sum(axis=1), 0.0)
        self._noise2 = max(1e-6, float(np.median(square[used])) / MEDIAN_OF_CHI2)
        self._weights = used / (1.0 + square / (FREE_PER_FRAME * self._noise2 * DAMPED**2))

    def _normal(self) -> tuple[Floats, Floats]:
        """What the frames say: information, and its pull."""
        weighted = self._jacobian * (self._weights / self._noise2)[:, None, None]
        normal = np.einsum("nij,nik->jk", weighted, self._jacobian, optimize=True)
        return normal, np.einsum("nij,ni->j", weighted, self._residual)

    def _prior(self) -> tuple[Floats, Floats]:
        """What is known beforehand: information, and its pull."""
        estimate, start = self._estimate, self._start
        unknowns = HEADINGS + len(estimate.headings)
        prior, right = np.zeros((unknowns, unknowns)), np.zeros(unknowns)
        prior[READOUT, READOUT] = 1.0 / max(start.readout_sigma_s, 1e-7) ** 2
        right[READOUT] = prior[READOUT, READOUT] * (estimate.readout_s - start.readout_s)
        prior[SLOPE, SLOPE] = np.eye(2) / LEVEL**2
        right[SLOPE] = estimate.slope / LEVEL**2
        between = np.diff(np.eye(len(estimate.headings)), axis=0) / HEADING_STEP
        prior[HEADINGS:, HEADINGS:] = between.T @ between
        right[HEADINGS:] = prior[HEADINGS:, HEADINGS:] @ estimate.headings
        return prior, right

    def _sigmas(self) -> Floats:
        sigmas: Floats = np.sqrt(np.diag(self._covariance())[: MOUNT.stop])
        if self._poses.rolled:
            sigmas[MOUNT] *= ROLLED
        return sigmas

    def _covariance(self) -> Floats:
        """By the curvature, or by how the frames' pulls hang together over time (Newey and West): the wider one."""
        normal, _ = self._normal()
        prior, _ = self._prior()
        inverse = np.linalg.inv(normal + prior)
        pulls = np.einsum("nij,ni->nj", self._jacobian, self._residual) * (self._weights / self._noise2)[:, None]
        together = _hanging_together(pulls, self._tag.times_s)
        seen: Floats = inverse @ (together + prior) @ inverse
        return np.where(np.diag(seen)[:, None] > np.diag(inverse)[:, None], seen, inverse)


def _hanging_together(pulls: Floats, times_s: Floats) -> Floats:
    """Products of all pulls by pairs of frames, less and less the further apart; ``times_s`` in order.

    Some frames at a time: all pairs of a minute at 200 frames/s would be gigabytes.
    """
    total = np.zeros((pulls.shape[1],) * 2)
    for begin in range(0, len(pulls), AT_ONCE):
        some = slice(begin, begin + AT_ONCE)
        first, last = np.searchsorted(times_s, [times_s[some][0] - MEMORY_S, times_s[some][-1] + MEMORY_S])
        near = slice(int(first), int(last))
        apart_s = np.abs(times_s[some, None] - times_s[None, near])
        total += pulls[some].T @ np.maximum(0.0, 1.0 - apart_s / MEMORY_S) @ pulls[near]
    return total
