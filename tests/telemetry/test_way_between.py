"""The way between two instants by reported velocities: neither the noise of positions nor a jump of them is in it."""

from math import cos, sin

import numpy as np
import pytest

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.telemetry.hermite_series import HermiteSeries


def ns(seconds):
    return BootNs(round(seconds * 1e9))


def positions(noise_m=0.0, speed_noise_m_s=0.0, jump_m=0.0, seed=0):
    """A vehicle on north = sin(t), east = 0.3 t, reported at 10 Hz; all positions from 2 s on are moved by a jump."""
    random, series = np.random.default_rng(seed), HermiteSeries()
    for t in np.arange(0.0, 4.0, 0.1):
        jumped = jump_m if t >= 2.0 else 0.0
        place = np.add((sin(t) + jumped, 0.3 * t, 0.0), random.normal(0.0, noise_m, 3))
        series.insert(ns(t), tuple(place), tuple(np.add((cos(t), 0.3, 0.0), random.normal(0.0, speed_noise_m_s, 3))))
        if jumped and t < 2.05:
            series.split_at(ns(t))
    return series


def test_way_between_two_instants_is_that_of_the_motion():
    way = positions().way_between(ns(1.03), ns(2.47))
    assert way == pytest.approx((sin(2.47) - sin(1.03), 0.3 * 1.44, 0.0), abs=2e-3)


def test_way_between_two_instants_lacks_the_noise_and_the_jump_of_positions():
    way = positions(noise_m=0.5, jump_m=2.0).way_between(ns(1.03), ns(2.47))
    assert way == pytest.approx(positions().way_between(ns(1.03), ns(2.47)), abs=0.02)


def test_noise_of_many_velocities_averages_out_of_the_way():
    ways = [positions(speed_noise_m_s=0.05, seed=seed).way_between(ns(1.0), ns(2.5)) for seed in range(50)]
    assert np.std(ways, axis=0).max() < 0.03, "of two velocities alone it would be 0.053 m"


def test_way_beyond_the_known_positions_is_not_known():
    assert positions().way_between(ns(1.0), ns(9.0)) is None
    assert HermiteSeries().way_between(ns(1.0), ns(1.1)) is None
