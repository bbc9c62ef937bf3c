"""Fits delay and mount to the corners by iteratively reweighted least squares; sigmas come from the residuals.

Each round fixes the whitening (corner noise, attitude noise, the eliminated camera positions) and the frames' weights
(Cauchy; Huber and Ronchetti 2009) at the present parameters, and ``scipy.optimize.least_squares`` solves that problem.
"""

from __future__ import annotations

from math import radians
from typing import Final

import msgspec
import numpy as np
from scipy.optimize import least_squares

from fwav_companion.tools.shake.observations import AttitudeSeries, Flags, Floats, TagObservations
from fwav_companion.tools.shake.residuals import (
    HEADINGS,
    MOUNT,
    READOUT,
    SLOPE,
    CornerModel,
    CornerParameters,
    CornerResiduals,
)

HEADING_STEP: Final = radians(1.0)
"""One sigma of the heading's change from knot to knot: that of compasses turned by hand indoors."""
LEVEL: Final = radians(0.5)
"""One sigma of the slope of ground that people call level, radians: 9 mm on a metre."""
ROUNDS: Final = 20
"""Most rounds. A rolling shutter, where the camera's own speed moves the rows, takes the most."""
SETTLED: Final = 0.02
"""Largest step of a parameter in the last round, in sigmas."""
SOLVED: Final = 1e-4
"""Relative tolerance of the sum of squares within a round; the rounds go on until they settle."""
LARGEST_DELAY_CHANGE_S: Final = 0.2
LARGEST_MOUNT_CHANGE: Final = 1.0
"""Largest changes from the coarse alignment, seconds and radians. A fit that leaves this range has diverged."""
FIRST_NOISE_PX: Final = 0.3
"""One sigma of a corner before the residuals are known."""
DAMPED: Final = 4.0
"""Scale of the Cauchy weights in sigmas. They reduce the effect of outliers: a corner on a finger, a blur."""
FREE_PER_FRAME: Final = 5.0
"""Degrees of freedom of a frame: eight pixel coordinates of four corners, less the camera position."""
FREE_PER_UNKNOWN: Final = 4
"""Least degrees of freedom for each unknown: with fewer frames the unknowns would follow the noise."""
MEDIAN_OF_CHI2: Final = 4.35
"""Median of the chi-square distribution with five degrees of freedom."""
MEMORY_S: Final = 0.5
"""Correlation time of the corners' errors: they depend on how the tag lies in the image."""
BLOCK: Final = 256
"""Frames that are multiplied with their neighbours at once."""
ROLLED: Final = 1.25
"""Factor on the mount's sigmas under a rolling shutter, where the speeds couple the frames: over 60 sessions, the error
of the mount's yaw was this multiple of the claim by the residuals."""


class FitStart(msgspec.Struct, frozen=True, kw_only=True):
    """Initial values and priors."""

    delay_s: float
    camera_from_body: Floats
    """(3, 3) rotation."""
    readout_s: float
    readout_sigma_s: float
    """One sigma of the readout, seconds; 0 if it is known."""
    attitude_noise: float
    """One sigma of each attitude about each axis, radians."""


class CornerFit(msgspec.Struct, frozen=True, kw_only=True):
    """Delay and mount by the corners."""

    delay_s: float
    body_from_camera: Floats
    """(3, 3) rotation."""
    readout_s: float
    sigmas: Floats
    """(4,) sigmas: of the delay in seconds, then of the mount about each body axis in radians."""
    pixel_sigma: float
    """Estimated sigma of a corner, one axis, pixels."""
    frames: int
    """Number of frames with known attitudes."""


def fit_corners(
    observations: TagObservations, attitudes: AttitudeSeries, start: FitStart, tag_size_m: float
) -> CornerFit | None:
    """The fit; None where too few frames have attitudes, or where it does not converge."""
    model = CornerModel(observations, attitudes, tag_size_m)
    motion = model.motion(start.delay_s, start.readout_s)
    if not _enough(motion.known, model):
        return None
    headings = np.full(model.knots, model.heading(start.camera_from_body, motion))
    parameters = CornerParameters(
        delay_s=start.delay_s,
        camera_from_body=start.camera_from_body,
        readout_s=start.readout_s,
        slope=np.zeros(2),
        headings=headings,
    )
    problem = WhitenedCorners(model, start, parameters)
    for _ in range(ROUNDS):
        step = least_squares(
            problem.residuals, np.zeros(model.unknowns), problem.jacobian, method="lm", ftol=SOLVED, xtol=SOLVED
        ).x
        settled = problem.in_sigmas(step)[:READOUT].max() < SETTLED
        problem.relinearize(step)
        if _diverged(problem.parameters, start) or not _enough(problem.known, model):
            return None
        if settled:
            return problem.solution()
    return None


def _enough(known: Flags, model: CornerModel) -> bool:
    return bool(known.sum() >= len(known) / 2 and known.sum() * FREE_PER_FRAME >= FREE_PER_UNKNOWN * model.unknowns)


def _diverged(parameters: CornerParameters, start: FitStart) -> bool:
    turned = 0.5 * (np.trace(parameters.camera_from_body.T @ start.camera_from_body) - 1.0)
    moved_s = abs(parameters.delay_s - start.delay_s)
    return not (moved_s <= LARGEST_DELAY_CHANGE_S and turned >= np.cos(LARGEST_MOUNT_CHANGE))


class WhitenedCorners:
    """The least-squares problem of one round: corner residuals with unit noise, then the priors' rows.

    ``parameters`` is the linearization point; a step is counted from there.
    """

    def __init__(self, model: CornerModel, start: FitStart, parameters: CornerParameters) -> None:
        self._model, self._start = model, start
        self._prior_rows = _prior_rows(start, model.knots)
        self.parameters = parameters
        self._noise2 = FIRST_NOISE_PX**2
        self._step: Floats = np.zeros(model.unknowns)
        self._at = model.residuals(parameters)
        self._reweight()

    @property
    def known(self) -> Flags:
        """(N,) whether each frame has attitudes."""
        return self._at.motion.known

    def relinearize(self, step: Floats) -> None:
        """Move the linearization point by a step, and compute whitening, noise and weights there."""
        self._at = self._moved(step)
        self.parameters, self._step = self.parameters.moved(step), np.zeros(len(step))
        self._reweight()

    def in_sigmas(self, step: Floats) -> Floats:
        """(unknowns,) absolute steps in sigmas, each with all other unknowns fixed."""
        return np.abs(step * np.sqrt(np.diag(self._information)))

    def _reweight(self) -> None:
        """Noise of the corners by the median frame, weight of each frame by its own residuals (Cauchy)."""
        whitening = _whitening(self._at, self._start.attitude_noise / np.sqrt(self._noise2))
        square = np.where(self.known, ((whitening @ self._at.residual[..., None]) ** 2).sum(axis=(1, 2)), 0.0)
        self._noise2 = max(1e-6, float(np.median(square[self.known])) / MEDIAN_OF_CHI2) if self.known.any() else np.inf
        weights = self.known / (1.0 + square / (FREE_PER_FRAME * self._noise2 * DAMPED**2))
        self._whitening = whitening * np.sqrt(weights / self._noise2)[:, None, None]
        jacobian = self.jacobian(self._step)
        self._information: Floats = jacobian.T @ jacobian

    def residuals(self, step: Floats) -> Floats:
        """(8 N + priors,) whitened residuals after a step from the linearization point."""
        whitened = (self._whitening @ self._moved(step).residual[..., None]).ravel()
        return np.concatenate([whitened, self._prior_rows @ self._from_prior(step)])

    def jacobian(self, step: Floats) -> Floats:
        """Derivatives of the whitened residuals by the step."""
        by_step = (self._whitening @ self._moved(step).jacobian).reshape(-1, len(step))
        return np.concatenate([by_step, self._prior_rows])

    def solution(self) -> CornerFit:
        """The parameters of the linearization point with their sigmas; right after :meth:`relinearize`."""
        sigmas: Floats = np.sqrt(np.diag(self._covariance())[: MOUNT.stop])
        if self._at.motion.rolling:
            sigmas[MOUNT] *= ROLLED
        return CornerFit(
            delay_s=self.parameters.delay_s,
            body_from_camera=self.parameters.camera_from_body.T,
            readout_s=self.parameters.readout_s,
            sigmas=sigmas,
            pixel_sigma=float(np.sqrt(self._noise2)),
            frames=int(self._at.motion.known.sum()),
        )

    def _moved(self, step: Floats) -> CornerResiduals:
        """Residuals after a step; the last ones are kept, since scipy asks for their Jacobian separately."""
        if not np.array_equal(step, self._step):
            self._step = step.copy()
            self._at = self._model.residuals(self.parameters.moved(step))
        return self._at

    def _from_prior(self, step: Floats) -> Floats:
        """(unknowns,) differences from the priors' means; 0 where an unknown has no prior."""
        parameters = self.parameters.moved(step)
        difference = np.zeros(len(step))
        difference[READOUT] = parameters.readout_s - self._start.readout_s
        difference[SLOPE], difference[HEADINGS:] = parameters.slope, parameters.headings
        return difference

    def _covariance(self) -> Floats:
        """The larger of two: inverse information, and one robust to errors correlated in time (Newey and West 1987)."""
        inverse = np.linalg.inv(self._information)
        whitened = self._whitening @ np.concatenate([self._at.residual[..., None], self._at.jacobian], axis=2)
        gradients = np.einsum("nij,ni->nj", whitened[..., 1:], whitened[..., 0])
        together = _correlated_products(gradients, self._model.times_s) + self._prior_rows.T @ self._prior_rows
        robust: Floats = inverse @ together @ inverse
        return np.where(np.diag(robust)[:, None] > np.diag(inverse)[:, None], robust, inverse)


def _prior_rows(start: FitStart, knots: int) -> Floats:
    """(priors, unknowns) rows that scale differences from the priors' means to unit variance."""
    rows = np.zeros((3 + knots - 1, HEADINGS + knots))
    rows[0, READOUT] = 1.0 / max(start.readout_sigma_s, 1e-7)
    rows[1:3, SLOPE] = np.eye(2) / LEVEL
    rows[3:, HEADINGS:] = np.diff(np.eye(knots), axis=0) / HEADING_STEP
    return rows


def _whitening(at: CornerResiduals, attitude_noise: float) -> Floats:
    """(N, 8, 8) maps to unit corner noise that include the attitude's noise and project the camera position out.

    ``attitude_noise``: attitude noise over corner noise, radians per pixel.
    """
    by_attitude = at.jacobian[:, :, MOUNT] * attitude_noise
    scale = np.linalg.cholesky(np.eye(8) + by_attitude @ np.swapaxes(by_attitude, 1, 2))
    own, _ = np.linalg.qr(np.linalg.solve(scale, at.by_position))
    whitening: Floats = (np.eye(8) - own @ np.swapaxes(own, 1, 2)) @ np.linalg.inv(scale)
    return whitening


def _correlated_products(gradients: Floats, times_s: Floats) -> Floats:
    """Sum of the products of all pairs of frames' gradients, weighted down linearly to 0 at MEMORY_S apart.

    ``times_s`` is in order. Blocks of frames, since all pairs of a minute at 200 frames/s would take gigabytes.
    """
    total = np.zeros((gradients.shape[1],) * 2)
    for begin in range(0, len(gradients), BLOCK):
        block = slice(begin, begin + BLOCK)
        first, last = np.searchsorted(times_s, [times_s[block][0] - MEMORY_S, times_s[block][-1] + MEMORY_S])
        near = slice(int(first), int(last))
        apart_s = np.abs(times_s[block, None] - times_s[None, near])
        total += gradients[block].T @ np.maximum(0.0, 1.0 - apart_s / MEMORY_S) @ gradients[near]
    return total
