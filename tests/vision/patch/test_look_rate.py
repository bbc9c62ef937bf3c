"""How often spots are looked for, by what a picture costs."""

from __future__ import annotations

import pytest

from fwav_companion.vision.patch import LookRate


def flown(cost_s, seconds=20.0, fps=30.0):
    """(looks a second, share of a core) over the last half of a flight."""
    rate, looks, half = LookRate(), 0, seconds / 2.0
    for number in range(round(seconds * fps)):
        now_s = number / fps
        if rate.is_due(now_s):
            rate.spent(cost_s)
            looks += now_s >= half
    return looks / half, looks * cost_s / half


def test_a_quick_board_looks_in_every_picture():
    assert flown(0.002)[0] == pytest.approx(30.0, abs=0.2)


@pytest.mark.parametrize("cost_s", [0.004, 0.01, 0.03])
def test_a_slow_board_looks_at_a_lower_rate_and_stays_below_a_tenth_of_a_core(cost_s):
    looks_hz, share = flown(cost_s)
    assert share <= 0.1
    assert 0.5 * 0.1 / cost_s < looks_hz < 30.0


def test_it_never_stops():
    assert flown(1.0)[0] == pytest.approx(2.0, abs=0.2)


def test_a_board_that_is_busy_for_a_moment_comes_back():
    rate = LookRate()
    assert rate.is_due(0.0)
    rate.spent(0.5)
    assert rate.interval_s > 0.4
    now_s = 0.0
    for _ in range(40):
        now_s += 1.0
        assert rate.is_due(now_s)
        rate.spent(0.001)
    assert rate.interval_s < 1.0 / 30.0
