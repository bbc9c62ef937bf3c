"""What no estimator can beat where no request is answered: the posterior median of one that knows how delays are drawn.

An arrival is its stamp plus the offset, the least delay, and an exponential delay; the stamp is truncated to whole
milliseconds, and the rate is drawn uniformly. The clock itself knows neither the least delay nor how they
scatter.
"""

from statistics import median

import numpy as np
from clock_draws import MOST_PPM, Flown

STEPS_S = 5.0
"""Time between the instants that are judged: those of the steady error, fewer of them."""
SKEWS, OFFSETS = 21, 160
MS = 1e-3


def least_error_s(flown: Flown) -> float:
    """Median of the optimum's steady error in one sequence, seconds, beyond the least delay."""
    kind = flown.world.kind
    arrivals, stamps = np.array(flown.arrivals).T
    errors = []
    for at in np.arange(2.0 * STEPS_S, kind.seconds, STEPS_S):
        heard = arrivals <= at
        offset = _posterior_median(arrivals[heard] - at, arrivals[heard] - stamps[heard], kind.stream_jitter_s)
        errors.append(abs(offset - kind.stream_base_s - (at - flown.world.boot(at))))
    return median(errors)


def _posterior_median(since: np.ndarray, late: np.ndarray, tail_s: float) -> float:
    """Median of offset plus least delay now. ``since``: (N,) arrivals, seconds; ``late``: (N,) arrival minus stamp."""
    skews = np.linspace(-MOST_PPM, MOST_PPM, SKEWS) * 1e-6
    reach = 12.0 * (tail_s / len(late) + MS / 4.0)
    above = late[:, None] - skews * since[:, None]  # (N, S)
    offsets = above.min() - reach + np.linspace(0.0, 2.0 * reach, OFFSETS)  # (K,)
    delay = above[:, :, None] - offsets  # (N, S, K): exponential delay and truncation together
    beyond = np.maximum(delay - MS, 0.0)
    within = np.clip(delay, 1e-12, MS)
    logs = np.log1p(-np.exp(-within / tail_s)) - beyond / tail_s
    total = np.where((delay > 0.0).all(axis=0), logs.sum(axis=0), -np.inf)  # (S, K)
    share = np.exp(total - total.max()).sum(axis=0).cumsum()  # (K,)
    return float(np.interp(0.5 * share[-1], share, offsets))
