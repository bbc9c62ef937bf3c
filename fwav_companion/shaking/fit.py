"""Delay and mount by least squares on the corners' pixels, with sigmas that believe the residuals and not the noise.

    point in the camera = camera_from_body * body_from_ned(row's capture - delay) * (corner in NED - camera's place)

The camera's place is each frame's own and is worked out of it again (nobody knows how a hand moves). Common to all are
the delay, the mount, an unknown readout, the slope of the ground the tag lies on, and the tag's heading, which may
drift: a compass held in a hand does. The slope is what the turn by a quarter tells from the mount.
"""

from __future__ import annotations

from math import radians
from typing import Final

import msgspec
import numpy as np

from fwav_companion.shaking.looks import Course, Looks
from fwav_companion.shaking.square_pose import SQUARE
from fwav_companion.shaking.turns import Floats, exp, skew, transposed

DELAY: Final = 0
MOUNT: Final = slice(1, 4)
READOUT: Final = 4
SLOPE: Final = slice(5, 7)
HEADINGS: Final = 7
"""The columns of the unknowns; the headings' knots are the rest."""
KNOT_S: Final = 2.5
HEADING_STEP: Final = radians(1.0)
"""One sigma by which heading may drift from knot to knot: what compasses do when they are turned by hand indoors."""
LEVEL: Final = radians(0.5)
"""One sigma of the slope of what people call level: 9 mm on a metre."""
STEPS: Final = 30
"""A rolling shutter, whose rows the hand's own speed moves, takes a dozen."""
SETTLED: Final = 0.02
"""A step of so many sigmas changes nothing."""
TRIED: Final = 1e-4
"""rad: the mount's derivatives are taken by trying, since the speeds of the hand hang on it too."""
FIRST_NOISE_PX: Final = 0.3
"""Of a corner, until the residuals tell."""
DAMPED: Final = 4.0
"""Frames that miss by more than so many sigmas count for less and less (Cauchy): a corner on a finger, a blur."""
MEMORY_S: Final = 0.5
"""Errors of corners hang together over so long: they come of how the tag lies in the image."""
AT_ONCE: Final = 256
"""Frames that are compared with those near them."""
FREE_PER_FRAME: Final = 5.0
"""Eight pixels of four corners, less the camera's place."""
MEDIAN_OF_CHI2: Final = 4.35
"""Of five degrees of freedom."""
SMOOTHED: Final = 9
"""Frames over which the hand's speed is taken: a third of a second, in which an arm does not turn back."""
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
    state = _State(looks, course, start, tag_size_m)
    for _ in range(STEPS):
        if not state.look() or not state.step():
            return None
        if state.rest < SETTLED:
            break
    else:
        return None
    return state.answer() if state.look() else None


class _State:
    """The estimate on its way."""

    def __init__(self, looks: Looks, course: Course, start: Start, tag_size_m: float) -> None:
        self._looks, self._course, self._size_m = looks, course, tag_size_m
        self._delay_s, self._readout_s = start.delay_s, start.readout_s
        self._readout_prior = (start.readout_s, start.readout_sigma_s)
        self._camera_from_body = start.camera_from_body
        self._attitude_noise = start.attitude_noise
        knots = 2 + int(np.ptp(looks.times_s) / KNOT_S)
        self._knots_s = looks.times_s.min() + KNOT_S * np.arange(knots)
        self._hats = _hats(looks.times_s, self._knots_s)
        self._slope, self._headings = np.zeros(2), np.zeros(knots)
        self._headings_known = False
        self._count = HEADINGS + knots
        self._noise2 = FIRST_NOISE_PX**2
        self.rest = np.inf

    # A look at how far the estimate is off.

    def look(self) -> bool:
        """Where the corners should be and are, frame by frame; False where attitudes are missing for most."""
        looks = self._looks
        instants_s = looks.times_s[:, None] + self._readout_s * looks.rows - self._delay_s
        middles_s = instants_s.mean(axis=1)
        ned_from_body, known = self._course.at(middles_s)
        rates, sure = self._course.rates(middles_s)
        used = known & sure
        if used.sum() < len(looks) / 2 or used.sum() * FREE_PER_FRAME < 4 * self._count:
            return False
        self._used, self._rates = used, rates[:, None, :]
        self._rows_s = instants_s - middles_s[:, None]
        within = exp(self._rates * self._rows_s[..., None])
        self._body_from_ned = transposed(ned_from_body[:, None] @ within)
        if not self._headings_known:
            self._find_heading()
        self._corners = self._corners_ned()
        self._project()
        return True

    def _find_heading(self) -> None:
        """The tag's heading by the first look's mount: the mean over the frames, as a direction."""
        camera_from_ned = self._camera_from_body @ self._body_from_ned
        rays = (transposed(camera_from_ned) @ self._looks.rays[..., None])[..., 0]
        flat = rays[..., :2] / np.maximum(rays[..., 2:], 0.05)
        along = (flat[:, 1] - flat[:, 0] + flat[:, 2] - flat[:, 3])[self._used]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        north, east = along.mean(axis=0)
        self._headings[:] = np.arctan2(east, north)
        self._headings_known = True

    def _corners_ned(self) -> Floats:
        """(N, 4, 3) metres from the tag's middle."""
        headings = self._hats @ self._headings
        turned = exp(np.stack([np.zeros_like(headings), np.zeros_like(headings), headings], axis=-1))
        slope = exp(np.array([*self._slope, 0.0]))
        corners: Floats = (slope @ turned)[:, None] @ (self._size_m * SQUARE)[None, :, :, None]
        return corners[..., 0]

    def _points(self, camera_from_body: Floats) -> tuple[Floats, Floats]:
        """(N, 4, 3) the corners from the camera in NED, and (N, 4, 3, 3) camera_from_ned, with such a mount.

        Each frame's place is the point nearest to its four rays; where rows differ in time the hand's speed counts.
        """
        camera_from_ned = camera_from_body @ self._body_from_ned
        rays = (transposed(camera_from_ned) @ self._looks.rays[..., None])[..., 0]
        across = np.eye(3) - rays[..., :, None] * rays[..., None, :]
        drift = np.zeros_like(rays)
        for _ in range(2 if self._rows_s.any() else 1):
            right = (across @ (self._corners - drift)[..., None]).sum(axis=1)
            place = np.linalg.solve(across.sum(axis=1), right)[..., 0]
            drift = self._rows_s[..., None] * _speeds(place, self._looks.times_s)[:, None, :]
        return self._corners - place[:, None, :] - drift, camera_from_ned

    def _misses(self, arms: Floats, camera_from_ned: Floats) -> tuple[Floats, Floats]:
        """(N, 8) pixels by which the corners are missed, (N, 4, 2, 3) the same by the point in NED."""
        points = (camera_from_ned @ arms[..., None])[..., 0]
        length = np.linalg.norm(points, axis=-1, keepdims=True)
        direction = points / length
        across = (np.eye(3) - direction[..., :, None] * direction[..., None, :]) / length[..., None]
        residual = (self._looks.pixel_from_ray @ (direction - self._looks.rays)[..., None])[..., 0]
        return residual.reshape(-1, 8), self._looks.pixel_from_ray @ across @ camera_from_ned

    def _project(self) -> None:
        """Residuals and their derivatives, in pixels, with each frame's own place worked out of both."""
        arms, camera_from_ned = self._points(self._camera_from_body)
        residual, by_point = self._misses(arms, camera_from_ned)
        frames = len(residual)
        jacobian = np.zeros((frames, 8, self._count))
        later = np.cross(self._rates, (self._body_from_ned @ arms[..., None])[..., 0])
        by_delay = by_point @ (transposed(self._body_from_ned) @ later[..., None])  # the attitude is an earlier one
        jacobian[:, :, DELAY] = by_delay.reshape(frames, 8)
        jacobian[:, :, READOUT] = -(by_delay[..., 0] * self._looks.rows[..., None]).reshape(frames, 8)
        by_turn = (-by_point @ skew(self._corners)).reshape(frames, 8, 3)
        jacobian[:, :, SLOPE] = by_turn[..., :2]
        jacobian[:, :, HEADINGS:] = by_turn[..., 2:] * self._hats[:, None, :]
        for axis in range(3):
            turned, _ = self._misses(*self._points(self._camera_from_body @ exp(-TRIED * np.eye(3)[axis])))
            jacobian[:, :, MOUNT.start + axis] = (turned - residual) / TRIED
        self._whiten(residual, jacobian, by_point.reshape(frames, 8, 3))
        self._weigh()

    def _whiten(self, residual: Floats, jacobian: Floats, by_place: Floats) -> None:
        """Without what each frame's place takes up, and in units of a corner's noise once its attitude's is counted."""
        by_attitude = jacobian[:, :, MOUNT] * (self._attitude_noise / np.sqrt(self._noise2))
        scale = np.linalg.cholesky(np.eye(8) + by_attitude @ transposed(by_attitude))
        own, _ = np.linalg.qr(np.linalg.solve(scale, by_place))
        both = np.linalg.solve(scale, np.concatenate([residual[..., None], jacobian], axis=2))
        both = both - own @ (transposed(own) @ both)
        self._residual, self._jacobian = both[..., 0], both[..., 1:]

    def _weigh(self) -> None:
        """The corners' noise by the median frame, and each frame's weight by its own."""
        square = np.where(self._used, (self._residual**2).sum(axis=1), 0.0)
        self._noise2 = max(1e-6, float(np.median(square[self._used])) / MEDIAN_OF_CHI2)
        self._weights = self._used / (1.0 + square / (FREE_PER_FRAME * self._noise2 * DAMPED**2))

    # A step toward the truth.

    def step(self) -> bool:
        """Gauss and Newton; False where it leaps out of reach."""
        normal, right = self._normal()
        prior, prior_right = self._prior()
        step = -np.linalg.solve(normal + prior, right + prior_right).astype(np.float64)
        if not np.isfinite(step).all() or abs(step[DELAY]) > 0.2 or np.linalg.norm(step[MOUNT]) > 1.0:
            return False
        self.rest = float(np.abs(step * np.sqrt(np.diag(normal + prior)))[:READOUT].max())
        self._delay_s += step[DELAY]
        self._camera_from_body = self._camera_from_body @ exp(-step[MOUNT])
        self._readout_s += step[READOUT]
        self._slope = self._slope + step[SLOPE]
        self._headings = self._headings + step[HEADINGS:]
        return True

    def _normal(self) -> tuple[Floats, Floats]:
        weighted = self._jacobian * (self._weights / self._noise2)[:, None, None]
        normal = np.einsum("nij,nik->jk", weighted, self._jacobian, optimize=True)
        return normal, np.einsum("nij,ni->j", weighted, self._residual)

    def _prior(self) -> tuple[Floats, Floats]:
        """What is known beforehand: information, and its pull."""
        prior, right = np.zeros((self._count, self._count)), np.zeros(self._count)
        expected_s, sigma_s = self._readout_prior
        prior[READOUT, READOUT] = 1.0 / max(sigma_s, 1e-7) ** 2
        right[READOUT] = prior[READOUT, READOUT] * (self._readout_s - expected_s)
        prior[SLOPE, SLOPE] = np.eye(2) / LEVEL**2
        right[SLOPE] = self._slope / LEVEL**2
        between = np.diff(np.eye(len(self._headings)), axis=0) / HEADING_STEP
        prior[HEADINGS:, HEADINGS:] = between.T @ between
        right[HEADINGS:] = prior[HEADINGS:, HEADINGS:] @ self._headings
        return prior, right

    # What came of it.

    def answer(self) -> Fit:
        """The estimate as it stands."""
        return Fit(
            delay_s=float(self._delay_s),
            body_from_camera=self._camera_from_body.T,
            readout_s=float(self._readout_s),
            sigmas=self._sigmas(),
            pixel_sigma=float(np.sqrt(self._noise2)),
            frames=int(self._used.sum()),
        )

    def _sigmas(self) -> Floats:
        sigmas: Floats = np.sqrt(np.diag(self._covariance())[: MOUNT.stop])
        if self._rows_s.any():
            sigmas[MOUNT] *= ROLLED
        return sigmas

    def _covariance(self) -> Floats:
        """By the curvature, or by how the frames' pulls hang together over time (Newey and West): the wider one."""
        normal, _ = self._normal()
        prior, _ = self._prior()
        inverse = np.linalg.inv(normal + prior)
        pulls = np.einsum("nij,ni->nj", self._jacobian, self._residual) * (self._weights / self._noise2)[:, None]
        together = _hanging_together(pulls, self._looks.times_s)
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


def _hats(times_s: Floats, knots_s: Floats) -> Floats:
    """(N, knots) weights of straight lines between knots."""
    hats: Floats = np.maximum(0.0, 1.0 - np.abs(times_s[:, None] - knots_s[None, :]) / KNOT_S)
    return hats


def _speeds(places: Floats, times_s: Floats) -> Floats:
    """(N, 3) metres per second, smoothed."""
    kernel = np.ones(SMOOTHED) / SMOOTHED
    speeds = np.gradient(places, times_s, axis=0)
    padded = np.pad(speeds, ((SMOOTHED // 2, SMOOTHED // 2), (0, 0)), mode="edge")
    return np.stack([np.convolve(padded[:, axis], kernel, "valid") for axis in range(3)], axis=1)
