"""A whole flight of each trouble of TIMESYNC: the claim holds, the target is found, and nothing false is said."""

import pytest
from flying import fly
from timed_flights import CALM, GLOBAL_SHUTTER, MS, clock_errors, fly_and_bound, miss_m, seen

from fwav_companion.types import NoticeCode
from sitl_mock import scenario


@pytest.mark.parametrize("off_s", [(-0.115,), (0.115,), (-0.06, 0.15, -0.02)])
def test_clock_after_bad_first_exchanges_holds_its_claim_and_reports_nothing(off_s):
    flown = seen("unbiased", **{"autopilot.first_timesync_off_s": off_s})
    lines = [line for line in clock_errors(flown) if line.flight_s > 1.5]
    assert all(abs(line.error_s) < min(5.0 * MS, 3.0 * line.sigma_s) for line in lines)
    assert not {NoticeCode.CLOCK_RATE, NoticeCode.CLOCK_SLIPPED} & set(flown.companion.codes)
    assert miss_m(flown) < 0.05


def test_clock_whose_answers_are_late_one_way_holds_its_claim_and_reports_nothing():
    flown = seen("late_timesync")
    lines = [line for line in clock_errors(flown) if line.flight_s > 1.5]
    assert all(abs(line.error_s) < min(5.0 * MS, 3.0 * line.sigma_s + 0.2 * MS) for line in lines)
    assert not {NoticeCode.CLOCK_RATE, NoticeCode.CLOCK_SLIPPED} & set(flown.companion.codes)


def test_simulator_that_slows_down_to_four_fifths_for_twenty_seconds_is_followed_and_reported():
    """It loses 10 ms of each 50."""
    slips = tuple((6.0 + 0.05 * k, 0.01) for k in range(400))
    options = scenario("unbiased").but({**CALM, "autopilot.clock_slips": slips, "seconds": 34.0})
    flown = fly(options, GLOBAL_SHUTTER)
    changes = ((6.0, 8.5), (26.0, 28.5))
    lines = [line for line in clock_errors(flown) if line.flight_s > 1.5]
    judged = [line for line in lines if not any(begin <= line.flight_s < end for begin, end in changes)]
    assert all(abs(line.error_s) < min(12.0 * MS, 3.0 * line.sigma_s + 10.0 * MS) for line in judged)
    assert all(abs(line.error_s) < 1.0 * MS for line in lines if line.flight_s > 30.0)
    assert NoticeCode.CLOCK_RATE in flown.companion.codes
    assert NoticeCode.AUTOPILOT_REBOOTED not in flown.companion.codes


def test_clock_whose_answers_end_in_flight_stays_right():
    flown = seen("clock_falls_silent")
    lines = [line for line in clock_errors(flown) if line.flight_s > 1.5]
    assert all(abs(line.error_s) < 2.0 * MS for line in lines)


@pytest.mark.parametrize("hz", [10.0, 4.0, 1.0])
def test_clock_of_a_one_way_autopilot_is_right_to_the_least_delay(hz):
    """Its messages alone, and as few as an unasked autopilot sends; the wire delays each by a millisecond or more."""
    alone = {
        "autopilot.answers": "nothing",
        "autopilot.answers_timesync": False,
        "autopilot.sends_timesync": False,
        "autopilot.rates_hz": {"ATTITUDE": hz, "GLOBAL_POSITION_INT": hz, "SYSTEM_TIME": 1.0},
    }
    flown = fly_and_bound("silent_clock", alone)
    lines = [line for line in clock_errors(flown) if line.flight_s > 3.0]
    assert lines
    assert all(abs(line.error_s) < min(3.0 * MS, 3.0 * line.sigma_s) for line in lines)
    assert not {NoticeCode.CLOCK_RATE, NoticeCode.CLOCK_SLIPPED} & set(flown.companion.codes)
