"""Robust weights of sightings and surveys: how far each is from what all others predict.

A residual about a state that the sighting itself has bent is small whatever it shows: where the receiver wanders, one
detection moves the error about it, and one that was false by 37 sigmas weighed 0.98. So each is judged by its
innovation against the others, with the covariance of their prediction (leave one out; Cook & Weisberg 1982, ch. 2).
The weights are those of a redescending M-estimator (Black & Rangarajan 1996).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from fwav_companion.estimation.errors import Array

HALF: Final = 0.5  # weight above which a measurement counts
_WIDE_DISTANCE2 = 16.0  # squared distance at which a sighting's weight is a half
_SURVEY_DISTANCE2 = 9.0  # the same of a landmark's survey
_REGULAR = 1e-3  # share of its noise by which a sighting that alone shows its target stays judged


def wide_weights(distance2: Array) -> Array:
    """Weights where nothing is known yet: Cauchy's."""
    return 1.0 / (1.0 + distance2 / _WIDE_DISTANCE2)


def expected_weights(distance2: Array) -> Array:
    """A smooth step at four standard deviations of what the others predict."""
    return np.asarray(1.0 / (1.0 + np.exp((0.5 * (distance2 - _WIDE_DISTANCE2)).clip(-50.0, 50.0))))


def survey_weights(distance2: Array, before: Array) -> Array:
    """Weights (L,) of surveys by their squared distances from what the others predict, and their weights before.

    The probability that a survey is right, where at most one of those that count is wrong: left out, it lowers the cost
    of the fit by its squared distance. One that is left out returns by its own distance.
    """
    odds = np.exp((0.5 * (distance2 - _SURVEY_DISTANCE2)).clip(-50.0, 50.0))
    counts = before >= HALF
    return np.asarray(1.0 - odds / np.where(counts, 1.0 + odds[counts].sum(), 1.0 + odds))


def leave_one_out_distance2(residual: Array, known: Array, noise: Array, weight: Array) -> Array:
    """Squared distances (N,) of measurements from what all others predict, the prediction's covariance included.

    residual: (2, N) after the fit; known: (2, 2, N) covariance of the fit's prediction; noise: (2, 2, N), of which the
    fit used noise + (1 / weight - 1) times the unit matrix. Of a linear fit these are the innovations that a fit
    without the measurement gives.
    """
    used = noise.copy()
    used[0, 0] += 1.0 / weight - 1.0
    used[1, 1] += 1.0 / weight - 1.0
    gain = _times(used, _inverse((1.0 + _REGULAR) * used - known))
    innovation = (gain * residual).sum(1)
    covariance = noise + _times(gain, known)
    u, v = innovation
    a, b, c = covariance[0, 0], 0.5 * (covariance[0, 1] + covariance[1, 0]), covariance[1, 1]
    return np.asarray((u * u * c - 2.0 * u * v * b + v * v * a) / (a * c - b * b))


def _inverse(m: Array) -> Array:
    """Of (2, 2, N)."""
    inverse = np.empty_like(m)
    inverse[0, 0], inverse[1, 1], inverse[0, 1], inverse[1, 0] = m[1, 1], m[0, 0], -m[0, 1], -m[1, 0]
    return np.asarray(inverse / (m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]))


def _times(a: Array, b: Array) -> Array:
    """Products (2, 2, N)."""
    return np.asarray(np.einsum("ijn,jkn->ikn", a, b))
