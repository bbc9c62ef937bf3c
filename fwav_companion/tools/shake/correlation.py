"""Lags and axes by correlation: camera turns against attitude turns, and attitude turns against transmitted rates.

Between two frames, the tag's turn in camera axes equals the body's turn by the autopilot's attitude, in other axes:

    turn in the camera = camera_from_body * turn of the body

So at any delay the best orthogonal matrix between the two (Kabsch 1976) shows how well they correlate. The delay is
the one with the largest correlation. The matrix at this delay includes reversed and exchanged axes. No prior value of
delay or mount is needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fwav_companion.geometry.stamps import NS_PER_S
from fwav_companion.tools.shake.observations import AttitudeSeries, Flags, Floats, rotation_from_quaternions
from fwav_companion.types import AttitudeSample

Indexes: TypeAlias = NDArray[np.intp]

EARLIEST_S: Final = -0.2
LATEST_S: Final = 0.5
"""Largest delay: a frame that arrives half a second after its capture would be refused as too late."""
STEP_S: Final = 0.005
"""Step between delays: a twentieth of the fastest wing beat's quarter; the least-squares fit refines the delay."""
LEAST_APART_S: Final = 0.08
MOST_APART_S: Final = 0.25
"""Bounds of the time between two compared frames: long enough for a hand to turn by more than a corner's noise."""
LEAST_PAIRS: Final = 30
"""Least number of pairs: a second of frames."""
RIVAL_APART_S: Final = 0.06
"""Delays closer to one another than this belong to the same peak."""
CERTAIN_SIGMAS: Final = 5.0
"""Sigmas by which the weakest axis must exceed the noise before the sign of the determinant counts."""
OF_ITS_OWN: Final = 0.3
"""Least ratio of the weakest axis's turns to the next weaker one's. Rolling and pitching alone turn the body about
its third axis too, by the sine of their angles. There a reversed pitch cannot be distinguished from a mirrored image,
whatever the noise."""

LAGS_S: Final = np.arange(-0.02, 0.0605, 0.001)
"""Range of rate lags: a filter of two poles at 5 Hz is 45 ms late."""
WIDEST_GAP_S: Final = 0.1
LEAST_SAMPLES: Final = 100
LEAST_RATE: Final = 0.15
"""Least RMS rate, rad/s: slower turns do not show a lag above the noise of attitudes."""
MOST_LAG_SIGMA_S: Final = 0.005
"""A rate lag with a larger sigma is not reported."""
PARTS: Final = 10
"""Parts of the session; the sigma of the rate lag is a jackknife over them."""
REVERSED: Final = -0.5
"""A correlation below this is that of a reversed axis."""
AXES: Final = ("roll", "pitch", "yaw")


class CoarseAlignment(msgspec.Struct, frozen=True):
    """Delay and axes by correlation of the turns."""

    delay_s: float
    correlation: float
    """Correlation at the delay: 1 if the turns are equal but for the axes, 0 if they are unrelated."""
    rival_correlation: float
    """Largest correlation outside the peak of the delay. Periodic shaking correlates one period later, too."""
    camera_from_body: Floats
    """(3, 3) orthogonal; the determinant is -1 where an axis of one side is reversed against the other."""
    handed: bool
    """Whether all three axes turned enough for the sign of the determinant to be certain."""
    weakest: Floats
    """(3,) unit vector of the body axis with the smallest turns."""
    turned: Floats
    """(3,) turn about each body axis between two frames, RMS, radians."""


def align_coarsely(times_s: Floats, camera_from_tag: Rotation, attitudes: AttitudeSeries) -> CoarseAlignment | None:
    """The delay and axes with the largest correlation; None where no two frames can be compared.

    ``times_s``: (N,) capture of each frame by its stamp. ``camera_from_tag``: N poses by the tag's corners.
    """
    first, second = _pairs(times_s)
    if len(first) < LEAST_PAIRS:
        return None
    seen = (camera_from_tag[first] * camera_from_tag[second].inv()).as_rotvec()
    delays_s = np.arange(EARLIEST_S, LATEST_S + STEP_S / 2.0, STEP_S)
    by_delay = _body_turns(times_s, first, second=second, delays_s=delays_s, attitudes=attitudes)
    scored = [_correlation(seen, *turns_and_known) for turns_and_known in by_delay]
    scores = np.array([score for score, _ in scored])
    best = int(scores.argmax())
    if scores[best] <= 0.0:
        return None
    rivals = np.abs(delays_s - delays_s[best]) > RIVAL_APART_S
    turns, known = by_delay[best]
    seen, turns = seen[known], turns[known]
    camera_from_body, handed, weakest = _orthogonal(scored[best][1], seen, turns)
    return CoarseAlignment(
        delay_s=float(delays_s[best]),
        correlation=float(scores[best]),
        rival_correlation=float(scores[rivals].max()),
        camera_from_body=camera_from_body,
        handed=handed,
        weakest=weakest,
        turned=np.sqrt((turns**2).mean(axis=0)),
    )


def _pairs(times_s: Floats) -> tuple[Indexes, Indexes]:
    """Indexes of frames, and of the next frame that is far enough from each."""
    second = np.searchsorted(times_s, times_s + LEAST_APART_S)
    first = np.flatnonzero(second < len(times_s))
    second = second[first]
    near = times_s[second] - times_s[first] <= MOST_APART_S
    return first[near], second[near]


def _body_turns(
    times_s: Floats, first: Indexes, second: Indexes, delays_s: Floats, attitudes: AttitudeSeries
) -> list[tuple[Floats, Flags]]:
    """For each delay: (P, 3) rotation vectors of the body over the pairs, and (P,) whether they are known."""
    begin_s = times_s[0] - LATEST_S
    grid_s = np.arange(begin_s, times_s[-1] - EARLIEST_S + STEP_S, STEP_S)
    ned_from_body, known = attitudes.at(grid_s)
    turns = []
    for delay_s in delays_s:
        at = np.clip(np.rint((times_s - delay_s - begin_s) / STEP_S).astype(int), 0, len(grid_s) - 1)
        before, after = at[first], at[second]
        turn = (ned_from_body[before].inv() * ned_from_body[after]).as_rotvec()
        turns.append((turn, known[before] & known[after]))
    return turns


def _correlation(seen: Floats, turned: Floats, known: Flags) -> tuple[float, Floats]:
    """Correlation of camera and body turns after the best orthogonal matrix, and their (3, 3) cross products."""
    seen, turned = seen[known], turned[known]
    if len(seen) < len(known) / 2:
        return 0.0, np.zeros((3, 3))
    products = seen.T @ turned
    most = np.sqrt((seen**2).sum() * (turned**2).sum())
    return float(np.linalg.svd(products, compute_uv=False).sum() / max(most, 1e-12)), products


def _orthogonal(products: Floats, seen: Floats, turned: Floats) -> tuple[Floats, bool, Floats]:
    """The best orthogonal matrix, whether its handedness is certain, and its weakest axis.

    The matrix is a rotation unless the weakest axis is certain to be reversed.
    """
    u, _, vt = np.linalg.svd(products)
    free = u @ vt
    noise = np.sqrt(((seen - turned @ free.T) ** 2).mean())
    _, weaker, weakest = np.sqrt(((turned @ vt.T) ** 2).sum(axis=0))
    handed = bool(weakest > CERTAIN_SIGMAS * noise and weakest > OF_ITS_OWN * weaker)
    if np.linalg.det(free) > 0.0 or handed:
        return free, handed, vt[2]
    return u @ np.diag([1.0, 1.0, -1.0]) @ vt, handed, vt[2]


class RateLag(msgspec.Struct, frozen=True):
    """Lag of the transmitted body rates behind the attitudes.

    Attitudes integrate raw gyroscopes; the transmitted rates have passed a filter (ArduPilot: two poles at 20 Hz).
    """

    lag_s: float
    sigma_s: float
    reversed_axes: tuple[str, ...]
    """Axes whose rate has the opposite sign of the attitude's change."""


def rate_lag(samples: Sequence[AttitudeSample]) -> RateLag | None:
    """The lag with the largest correlation of rates and attitude changes; None where the samples do not show it."""
    if len(samples) < LEAST_SAMPLES:
        return None
    times_s = np.array([(sample.boot_ns - samples[0].boot_ns) / NS_PER_S for sample in samples])
    sent = np.array([sample.rates for sample in samples])
    middles_s, measured = _measured_rates(times_s, samples)
    if len(measured) < LEAST_SAMPLES or np.sqrt((measured**2).mean()) < LEAST_RATE or not sent.any():
        return None
    products = _rate_products(middles_s, measured, times_s, sent)
    total = products.sum(axis=1)
    lag_s = _peak(total)
    left_out = [_peak(total - part.sum(axis=1)) for part in np.array_split(products, PARTS, axis=1)]
    sigma_s = float(np.sqrt((PARTS - 1) * np.var(left_out)))
    if sigma_s > MOST_LAG_SIGMA_S:
        return None
    return RateLag(lag_s, sigma_s, _reversed_axes(total[int(np.abs(LAGS_S - lag_s).argmin())], measured))


def _measured_rates(times_s: Floats, samples: Sequence[AttitudeSample]) -> tuple[Floats, Floats]:
    """(M,) middles and (M, 3) rates of the attitude from each sample to the one after the next."""
    attitudes = rotation_from_quaternions(np.array([sample.ned_from_body for sample in samples]))
    spans_s = times_s[2:] - times_s[:-2]
    usable = (spans_s > 0.0) & (spans_s <= WIDEST_GAP_S)
    turns = (attitudes[:-2].inv() * attitudes[2:]).as_rotvec()[usable]
    return (0.5 * (times_s[2:] + times_s[:-2]))[usable], turns / spans_s[usable, None]


def _rate_products(middles_s: Floats, measured: Floats, times_s: Floats, sent: Floats) -> Floats:
    """(lags, M, 3) products of the measured rate and the one sent a lag later, by axis, normalised by the latter's RMS.

    Linear interpolation between samples is flatter than the signal, most of all halfway between two samples. Without
    the normalisation this would pull every lag to a whole number of samples.
    """
    later = np.stack([np.interp(middles_s[None, :] + LAGS_S[:, None], times_s, sent[:, axis]) for axis in range(3)], -1)
    size = np.sqrt((later**2).mean(axis=(1, 2), keepdims=True))
    products: Floats = later * measured / np.maximum(size, 1e-9)
    return products


def _peak(by_axis: Floats) -> float:
    """The lag with the largest correlation, whatever the axes' signs, interpolated by a parabola between lags."""
    score = np.abs(by_axis).sum(axis=1)
    best = int(np.clip(score.argmax(), 1, len(LAGS_S) - 2))
    before, at, after = score[best - 1 : best + 2]
    bend = before - 2.0 * at + after
    share = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return float(LAGS_S[best] + share * (LAGS_S[1] - LAGS_S[0]))


def _reversed_axes(products: Floats, measured: Floats) -> tuple[str, ...]:
    size = np.sqrt((measured**2).mean(axis=0))
    moved = size >= LEAST_RATE
    against = products < REVERSED * len(measured) * size**2 / max(float(np.sqrt((measured**2).mean())), 1e-9)
    return tuple(name for name, reverse in zip(AXES, moved & against, strict=True) if reverse)
