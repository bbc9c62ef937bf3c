"""Errors of a vehicle's position at some instants, drawn from their exact correlations: 1 m, along north and east."""

import numpy as np


def smooth_error(rng, times, time_s):
    """(n, 2) errors of a critically damped second-order process with this integral time."""
    w = 2.0 / time_s
    apart = w * np.abs(times[:, None] - times)
    root = np.linalg.cholesky((1.0 + apart) * np.exp(-apart) + 1e-9 * np.eye(len(times)))
    return root @ rng.standard_normal((len(times), 2))


def first_order_error(rng, times, time_s):
    """(n, 2) errors of a first-order Gauss-Markov process."""
    root = np.linalg.cholesky(np.exp(-np.abs(times[:, None] - times) / time_s))
    return root @ rng.standard_normal((len(times), 2))
