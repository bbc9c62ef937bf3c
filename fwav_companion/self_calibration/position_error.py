"""The error of the vehicle's reported position as states: all targets share it, and it wanders.

Receivers' errors move smoothly, some filters' do not, and no report states which. So there are two hypotheses of the
same sigma and time constant T: a second-order Gauss-Markov process with both poles at 2 / T (critically damped; Gelb
1974, ch. 2), and one with the poles 1 / T and 1 / QUICK_S, a first-order process beyond a second. Within a second
1 m moves by 0.03 m as the one and by 0.11 m as the other. What a flight shows decides, by likelihood.
"""

from __future__ import annotations

from math import exp, inf

import msgspec
import numpy as np

from fwav_companion.self_calibration.arrays import Array
from fwav_companion.types import Bias, ErrorPriors

QUICK_S = 1.0
QUICK, SMOOTH = range(2)
"""Index of each hypothesis."""
APART = 1e-3
"""Relative distance of the two poles of a critically damped process, for one formula of all transitions."""


class PositionError(msgspec.Struct, frozen=True):
    """The processes under each hypothesis (B); the states of each are north, east, and their rates."""

    poles: tuple[tuple[tuple[float, float], ...], ...]
    """(B, processes) poles, 1/s."""
    variance: Array
    """(B, states), prior."""
    by_state: Array
    """(2, states), the error's north and east by the states."""

    @property
    def count(self) -> int:
        """Number of states."""
        return len(self.by_state[0])

    def take(self, hypotheses: list[int]) -> PositionError:
        """Some of the hypotheses."""
        if not self.count:
            return self
        return PositionError(tuple(self.poles[i] for i in hypotheses), self.variance[hypotheses], self.by_state)

    def transition(self, seconds: float) -> Array:
        """(B, states, states), transition of the states over a time."""
        matrix = np.zeros((len(self.poles), self.count, self.count))
        for own, processes in zip(matrix, self.poles, strict=True):
            for i, (a, b) in enumerate(processes):
                slow, quick, apart = exp(-a * seconds), exp(-b * seconds), b - a
                step = (
                    (b * slow - a * quick) / apart,
                    (slow - quick) / apart,
                    a * b * (quick - slow) / apart,
                    (b * quick - a * slow) / apart,
                )
                for k in (4 * i, 4 * i + 1):
                    own[k, k], own[k, k + 2], own[k + 2, k], own[k + 2, k + 2] = step
        return matrix


def position_error(priors: ErrorPriors, hypotheses: tuple[int, ...]) -> PositionError:
    """The processes of these priors under each hypothesis; without any state where positions are exact."""
    sigmas = priors.bias_sigmas[Bias.POSITION_NORTH : Bias.POSITION_EAST + 1]
    if not any(sigmas):
        return PositionError((), np.zeros((len(hypotheses), 0)), np.zeros((2, 0)))
    times_s = [time_s if 0.0 < time_s < inf else 1e9 for time_s in priors.position_times_s]
    smooth = tuple((2.0 / t, 2.0 / t * (1.0 + APART)) for t in times_s)
    quick = tuple((1.0 / t, max(1.0 / QUICK_S, (1.0 + APART) / t)) for t in times_s)
    poles = tuple(smooth if each == SMOOTH else quick for each in hypotheses)
    variances = [sigma * sigma / len(times_s) for sigma in sigmas]
    variance = [[v * rate for a, b in each for rate in (1.0, a * b) for v in variances] for each in poles]
    one = np.concatenate((np.eye(2), np.zeros((2, 2))), 1)
    return PositionError(poles, np.array(variance), np.tile(one, len(times_s)))
