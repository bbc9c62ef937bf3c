"""Rates that come late, and rates with a wrong sign, against those that were planted."""

import pytest
from hands import Hands

from fwav_companion.tools.shake.correlation import rate_lag

HANDS = Hands(seed=2)


@pytest.mark.parametrize("lag_s", [0.0, 0.004, 0.011, 0.03])
def test_the_lag_is_found_within_a_millisecond_and_within_what_it_claims(lag_s):
    found = rate_lag(HANDS.samples(lag_s))
    assert found.lag_s == pytest.approx(lag_s, abs=1e-3)
    assert found.lag_s == pytest.approx(lag_s, abs=4 * found.sigma_s)
    assert found.sigma_s < 1e-3
    assert found.reversed_axes == ()


@pytest.mark.parametrize(("signs", "names"), [((-1, 1, 1), ("roll",)), ((1, -1, -1), ("pitch", "yaw"))])
def test_reversed_rates_are_named(signs, names):
    assert rate_lag(HANDS.samples(signs=signs)).reversed_axes == names


def test_motion_without_information():
    assert rate_lag([]) is None
    assert rate_lag(HANDS.samples()[:50]) is None
    assert rate_lag(HANDS.samples(signs=(0, 0, 0))) is None
    still = Hands(swing_deg=(0.0, 0.0, 0.0), flap_deg=0.0, turn_deg=0.0)
    assert rate_lag(still.samples()) is None
