"""Readiness: the first obstacle in the order of the data's path, and when a report is due."""

from math import inf

import pytest

from fwav_companion.publishing.announcer import MAX_BYTES
from fwav_companion.publishing.readiness import Readiness, ReadinessReports, obstacle, readiness_notice
from fwav_companion.types import NoticeCode, Reason, Severity

S = 10**9
GOOD = {
    "attitude_hz": 98.2,
    "wanted_attitude_hz": 100.0,
    "clock_sigma_s": 0.0006,
    "frames_hz": 30.1,
    "frame_age_s": 0.03,
    "within95_m": 1.04,
    "height_m": 10.2,
}
READY = NoticeCode.READY
BLIND, SLOW = NoticeCode.NOT_READY_NO_PICTURES, NoticeCode.NOT_READY_SLOW_ATTITUDE
NO_PICTURES = {"frame_age_s": 5.0}
CASES = [
    ({"attitude_hz": 0.0}, NoticeCode.NOT_READY_NO_ATTITUDE),
    ({"clock_sigma_s": inf}, NoticeCode.NOT_READY_NO_CLOCK),
    (NO_PICTURES, BLIND),
    ({"frame_age_s": inf}, BLIND),
    ({"refused": Reason.WRONG_SIZE}, NoticeCode.NOT_READY_PICTURES_REFUSED),
    ({"no_fix": Reason.NO_POSITION}, NoticeCode.NOT_READY_NO_POSITION),
    ({"no_fix": Reason.TERRAIN_UNFIT}, NoticeCode.NOT_READY_NO_HEIGHT),
    ({"no_fix": Reason.NO_GIMBAL}, NoticeCode.NOT_READY_NO_GIMBAL),
    ({"attitude_hz": 18.4}, SLOW),
]


def test_ready_in_one_line():
    notice = readiness_notice(Readiness(**GOOD))
    assert (notice.code, notice.severity, notice.to_ground) == (READY, Severity.INFO, True)
    assert notice.text == (
        "ready: attitude 98 Hz, camera 30/s, 95 % within: clock 1.2 ms, "
        "target 1.0 m (from 10 m, relative to the vehicle)"
    )


@pytest.mark.parametrize(("changes", "code"), CASES)
def test_each_obstacle_is_a_warning_for_the_ground_that_says_what_to_do(changes, code):
    notice = readiness_notice(Readiness(**GOOD | changes))
    assert (notice.code, notice.severity, notice.to_ground) == (code, Severity.WARNING, True)
    _, what, remedy = notice.text.split(": ")
    assert what
    assert remedy


@pytest.mark.parametrize("reason", Reason)
def test_every_reason_fits_into_a_text(reason):
    for changes in ({"refused": reason}, {"no_fix": reason}):
        assert len(readiness_notice(Readiness(**GOOD | changes)).text) <= MAX_BYTES


def test_the_first_obstacle_on_the_datas_path_is_named():
    """Later obstacles on the path are its consequences."""
    changes: dict = {}
    for change, code in reversed(CASES):
        changes |= change
        assert obstacle(Readiness(**GOOD | changes)).code is code


def test_a_view_without_ground_is_no_obstacle():
    assert obstacle(Readiness(**GOOD | {"no_fix": Reason.ABOVE_HORIZON, "within95_m": None})) is None


@pytest.mark.parametrize(("hz", "reported", "code"), [(79.0, READY, SLOW), (82.0, READY, READY), (82.0, SLOW, SLOW)])
def test_a_rate_at_the_limit_does_not_chatter(hz, reported, code):
    assert readiness_notice(Readiness(**GOOD | {"attitude_hz": hz}), reported).code is code


class Flight:
    """Wakes the reports as the pipeline does; ``course``: changes to a good state, each from its second on."""

    def __init__(self) -> None:
        self.reports = ReadinessReports()
        self.said: list[tuple[int, NoticeCode]] = []

    def run(self, first_s: int, last_s: int, changes=None) -> "Flight":
        for second in range(first_s, last_s):
            assert self.reports.wake_at == second * S
            self.note(self.reports.on_wake(Readiness(**GOOD | (changes or {})), second * S), second)
        return self

    def note(self, notice, second: int) -> None:
        if notice is not None:
            self.said.append((second, notice.code))


@pytest.fixture
def flight():
    flight = Flight()
    flight.reports.begin(0)
    return flight


def test_before_an_autopilot_is_adopted_nothing_is_due():
    assert ReadinessReports().wake_at is None


def test_ready_as_soon_as_it_can_be_judged_and_not_ready_after_five_seconds(flight):
    assert flight.run(1, 60).said == [(3, READY)]
    late = Flight()
    late.reports.begin(0)
    assert late.run(1, 60, NO_PICTURES).said == [(5, BLIND)]


def test_a_change_is_reported_when_it_has_held_for_three_seconds(flight):
    flight.run(1, 30).run(30, 40, NO_PICTURES).run(40, 60)
    assert flight.said == [(3, READY), (33, BLIND), (43, READY)]


def test_another_obstacle_is_a_change_too(flight):
    flight.run(1, 30, NO_PICTURES).run(30, 40, {"attitude_hz": 50.0})
    assert flight.said == [(5, BLIND), (33, SLOW)]


def test_a_state_that_flickers_is_not_reported(flight):
    flight.run(1, 10)
    for second in range(10, 100, 4):
        flight.run(second, second + 2, NO_PICTURES).run(second + 2, second + 4)
    assert flight.said == [(3, READY)]


def test_a_state_that_comes_and_goes_slowly_gives_at_most_two_lines_in_twenty_seconds(flight):
    flight.run(1, 10)
    for second in range(10, 210, 10):
        flight.run(second, second + 5, NO_PICTURES).run(second + 5, second + 10)
    times = [second for second, _ in flight.said]
    assert len(times) > 5
    assert min(third - first for first, third in zip(times, times[2:], strict=False)) >= 20


def test_what_an_overdue_heartbeat_may_explain_waits_for_it(flight):
    flight.run(1, 30).run(30, 40, NO_PICTURES | {"autopilot_silent": True})
    assert flight.said == [(3, READY)]
    assert flight.run(40, 41, NO_PICTURES).said[1:] == [(40, BLIND)]


def test_while_the_autopilot_is_lost_nothing_is_reported_and_then_it_is_judged_again(flight):
    flight.run(1, 10)
    flight.reports.stop()
    assert flight.reports.wake_at is None
    flight.reports.begin(20 * S)
    assert flight.run(21, 40).said == [(3, READY), (23, READY)]


def test_an_arming_repeats_the_state_of_now_but_not_what_was_just_reported(flight):
    armed = Readiness(**GOOD)
    assert flight.reports.on_armed(armed, S) is None, "not judged yet"
    flight.run(1, 8)
    assert flight.reports.on_armed(armed, 8 * S) is None, "reported five seconds ago"
    assert flight.reports.on_armed(armed, 14 * S).code is READY
    assert flight.reports.on_armed(Readiness(**GOOD | NO_PICTURES), 15 * S).code is BLIND, "not what was true before"


def test_a_slow_attitude_is_reported_when_the_meter_has_seen_two_seconds_of_the_requested_rate(flight):
    slow = {"attitude_hz": 41.0}
    flight.run(1, 9, slow | {"attitude_pending": True}).run(9, 14, slow)
    assert flight.said == [(10, SLOW)]


def test_a_slow_attitude_that_becomes_fast_by_our_request_is_never_reported(flight):
    flight.run(1, 6, {"attitude_hz": 41.0, "attitude_pending": True}).run(6, 7, {"attitude_hz": 41.0}).run(7, 20)
    assert flight.said == [(7, READY)]
