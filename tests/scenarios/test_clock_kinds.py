"""A whole flight of each trouble of TIMESYNC: the claim holds, the target is found, and nothing false is said."""

import pytest
from timed_flights import MS, clock_errors, miss_m, seen

from fwav_companion.types import NoticeCode


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


def test_clock_whose_answers_end_in_flight_stays_right():
    flown = seen("clock_falls_silent")
    lines = [line for line in clock_errors(flown) if line.flight_s > 1.5]
    assert all(abs(line.error_s) < 2.0 * MS for line in lines)
