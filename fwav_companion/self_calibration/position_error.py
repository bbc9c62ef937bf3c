"""States of the error of the vehicle's reported position, which wanders and which all targets share.

Errors of receivers move smoothly, errors of some filters do not, and no report states the kind. So there are two
hypotheses with the same sigma and time constant T: a second-order Gauss-Markov process with both poles at 2 / T
(critically damped; Gelb 1974, ch. 2), and one with the poles 1 / T and 1 / QUICK_S, a first-order process beyond a
second. Within a second an error of 1 m moves by 0.03 m under the former and by 0.11 m under the latter. The likelihood
of a flight's measurements decides.
"""

from __future__ import annotations

from math import inf

import msgspec
import numpy as np

from fwav_companion.self_calibration.arrays import Array
from fwav_companion.types import Bias, ErrorPriors

QUICK_S = 1.0
QUICK, SMOOTH = range(2)
"""Index of each hypothesis."""
APART = 1e-3
"""Relative distance of the two poles of a critically damped process, so that one formula gives all transitions."""
AXES = np.eye(2)
"""North and east move alike."""


class PositionError(msgspec.Struct, frozen=True):
    """The processes under each hypothesis (B); the states of each are north, east, and their rates."""

    poles: Array
    """(B, K), poles of the processes, 1/s."""
    modes: Array
    """(B, K, states, states): each decays by its pole, and their sum is the transition."""
    prior: Array
    """(B, states, states), stationary covariance of the states."""
    by_state: Array
    """(2, states), matrix from the states to north and east of the error."""

    @property
    def count(self) -> int:
        """Number of states."""
        return len(self.by_state[0])

    def take(self, hypotheses: list[int]) -> PositionError:
        """The processes under some of the hypotheses."""
        return PositionError(self.poles[hypotheses], self.modes[hypotheses], self.prior[hypotheses], self.by_state)

    def transition(self, seconds: float) -> Array:
        """(B, states, states), transition of the states over a time."""
        return np.asarray(np.einsum("bk,bkij->bij", np.exp(-seconds * self.poles), self.modes))


def position_error(priors: ErrorPriors, hypotheses: tuple[int, ...]) -> PositionError:
    """The processes of these priors under each hypothesis; without any state where positions are exact."""
    sigmas = priors.bias_sigmas[Bias.POSITION_NORTH : Bias.POSITION_EAST + 1]
    times_s = [time_s if 0.0 < time_s < inf else 1e9 for time_s in priors.position_times_s] if any(sigmas) else []
    smooth = [(2.0 / t, 2.0 / t * (1.0 + APART)) for t in times_s]
    quick = [(1.0 / t, max(1.0 / QUICK_S, (1.0 + APART) / t)) for t in times_s]
    processes, count = [smooth if each == SMOOTH else quick for each in hypotheses], 4 * len(times_s)
    modes = np.zeros((len(processes), 2 * len(times_s), count, count))
    prior = np.zeros((len(processes), count, count))
    for own_modes, own_prior, own in zip(modes, prior, processes, strict=True):
        for i, (a, b) in enumerate(own):
            states, apart = slice(4 * i, 4 * i + 4), b - a
            own_modes[2 * i, states, states] = np.kron([[b / apart, 1.0 / apart], [-a * b / apart, -a / apart]], AXES)
            own_modes[2 * i + 1, states, states] = np.kron(
                [[-a / apart, -1.0 / apart], [a * b / apart, b / apart]], AXES
            )
            own_prior[states, states] = np.diag(
                [v * rate / len(own) for rate in (1.0, a * b) for v in np.square(sigmas)]
            )
    poles = np.array(processes, float).reshape(len(processes), -1)
    return PositionError(poles, modes, prior, np.tile(np.eye(2, 4), len(times_s)))
