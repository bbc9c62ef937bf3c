"""How late the body rates come that an autopilot sends, against the course of its own attitudes.

Attitudes integrate raw gyroscopes; the rates beside them have been through a filter (ArduPilot: two poles at 20 Hz).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import msgspec
import numpy as np

from fwav_companion.geometry.stamps import NS_PER_S
from fwav_companion.tools.shake.turns import Floats, log, matrices, transposed
from fwav_companion.types import AttitudeSample

LAGS_S: Final = np.arange(-0.02, 0.0605, 0.001)
"""A filter of two poles at 5 Hz is 45 ms late."""
WIDEST_GAP_S: Final = 0.1
LEAST_SAMPLES: Final = 100
LEAST_RATE: Final = 0.15
"""rad/s, RMS: slower turns show no lag beside the noise of attitudes."""
MOST_SIGMA_S: Final = 0.005
"""What is known no better is not known."""
PARTS: Final = 10
"""Of the time, each left out once, for the sigma."""
AXES: Final = ("roll", "pitch", "yaw")
AGAINST: Final = -0.5
"""A correlation below this is that of a reversed axis."""


class RatesLag(msgspec.Struct, frozen=True):
    """How the rates follow."""

    lag_s: float
    sigma_s: float
    reversed: tuple[str, ...]
    """Axes whose rate has the other sign than the attitude's course."""


def rates_lag(samples: Sequence[AttitudeSample]) -> RatesLag | None:
    """None where too little was told or turned."""
    if len(samples) < LEAST_SAMPLES:
        return None
    times_s = np.array([(sample.boot_ns - samples[0].boot_ns) / NS_PER_S for sample in samples])
    sent = np.array([sample.rates for sample in samples])
    attitudes = matrices(np.array([sample.ned_from_body for sample in samples]))
    spans_s = times_s[2:] - times_s[:-2]
    fit = (spans_s > 0.0) & (spans_s <= WIDEST_GAP_S)
    turned = (log(transposed(attitudes[:-2]) @ attitudes[2:]) / spans_s[:, None])[fit]
    middles_s = (0.5 * (times_s[2:] + times_s[:-2]))[fit]
    if len(turned) < LEAST_SAMPLES or np.sqrt((turned**2).mean()) < LEAST_RATE or not sent.any():
        return None
    products = _products(middles_s, turned, times_s, sent)
    lag_s = _peak(products.sum(axis=1))
    parts = np.array_split(products, PARTS, axis=1)
    left_out = [_peak(products.sum(axis=1) - part.sum(axis=1)) for part in parts]
    sigma_s = float(np.sqrt((PARTS - 1) * np.var(left_out)))
    if sigma_s > MOST_SIGMA_S:
        return None
    return RatesLag(lag_s, sigma_s, _reversed(products.sum(axis=1)[_index(lag_s)], turned))


def _products(middles_s: Floats, turned: Floats, times_s: Floats, sent: Floats) -> Floats:
    """(lags, N, 3): the attitude's rate times the one sent so much later, by axis.

    In units of the later ones' size: straight lines between samples are flatter than what they stand for, the more
    so the further from the samples, which would draw every lag to a whole number of them.
    """
    later = np.stack([np.interp(middles_s[None, :] + LAGS_S[:, None], times_s, sent[:, axis]) for axis in range(3)], -1)
    size = np.sqrt((later**2).mean(axis=(1, 2), keepdims=True))
    together: Floats = later * turned / np.maximum(size, 1e-9)
    return together


def _peak(by_axis: Floats) -> float:
    """The lag at which the axes agree best, whatever their signs, between the lags that were tried."""
    score = np.abs(by_axis).sum(axis=1)
    best = int(np.clip(score.argmax(), 1, len(LAGS_S) - 2))
    before, at, after = score[best - 1 : best + 2]
    bend = before - 2.0 * at + after
    share = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return float(LAGS_S[best] + share * (LAGS_S[1] - LAGS_S[0]))


def _index(lag_s: float) -> int:
    return int(np.abs(LAGS_S - lag_s).argmin())


def _reversed(products: Floats, turned: Floats) -> tuple[str, ...]:
    size = np.sqrt((turned**2).mean(axis=0))
    moved = size >= LEAST_RATE
    against = products < AGAINST * len(turned) * size**2 / max(float(np.sqrt((turned**2).mean())), 1e-9)
    return tuple(name for name, turns in zip(AXES, moved & against, strict=True) if turns)
