"""Lines of the target log, and the lines that are not made without a reader."""

import pytest
from flying import Companion
from handmade import a_fix, a_view, host_ns
from report_lines import clock, sighting
from simulated_flight import priors

from fwav_companion.pipeline.target_log import TargetLog
from fwav_companion.recording.line_types import ClockEstimateLine, HeaderLine, HomeLine, TargetLine
from fwav_companion.tracking import Settled, TrackingOptions, make_tracker
from fwav_companion.types import Reason
from sitl_mock import scenario, simulate


def filled(target_log):
    target_log.keep_sightings(1000, 1, [sighting()])
    target_log.write(clock(0.0, 0.0))
    target_log.drop_frames(Reason.NO_CLOCK)
    target_log.begin(None)
    target_log.write(HomeLine(time_unix=0.0, down=0.0))
    return [type(line) for line in target_log.take()]


@pytest.mark.parametrize(
    ("written", "lines"), [(True, [HeaderLine, ClockEstimateLine, HomeLine]), (False, [HeaderLine])]
)
def test_lines_are_kept_for_who_takes_them_and_counts_always(written, lines):
    target_log = TargetLog("1.0", {}, 0, written=written)
    assert filled(target_log) == lines
    assert target_log.summary().dropped == {"no_clock": 1}


def lines_of(frames):
    """(seconds, state) of the target lines of these frames: (seconds, seen, looked for)."""
    tracker, log = make_tracker(TrackingOptions(), priors()), TargetLog("", {}, 0)
    log.begin(None)
    for t, seen, sees in frames:
        view = a_view(t, *([a_fix(t, (4.0, 3.0, 0.0))] if seen else []), sees=sees)
        log.settle([Settled(view, tracker.on_frame(view))], None)
    start_s = host_ns(0.0) / 1e9
    return [(round(line.time_unix - start_s, 1), line.state) for line in log.take() if isinstance(line, TargetLine)]


def test_a_track_has_a_line_where_it_is_seen_looked_for_or_changes_state_and_once_a_second():
    """Ten frames a second: one second in view, one missed, then out of view."""
    seen = [(k / 10, True, True) for k in range(10)]
    missed = [(1.0 + k / 10, False, True) for k in range(5)]
    away = [(1.5 + k / 10, False, False) for k in range(30)]
    times = [t for t, _ in lines_of(seen + missed + away)]
    assert times == [k / 10 for k in range(15)] + [2.4, 3.4, 4.4]


def test_a_track_out_of_view_has_a_line_of_its_change_of_state():
    lines = lines_of([(k / 10, k < 10, k < 10) for k in range(15)])
    assert lines[10:] == [(1.2, "coasting")]


class Waking(Companion):
    """A companion that counts how often it is woken."""

    wakes = 0

    def on_wake(self, now_ns: int) -> list[bytes]:
        self.wakes += 1
        return super().on_wake(now_ns)


def test_without_lines_no_wake_settles_a_frame_and_the_counts_are_the_same():
    flown = []
    for written in (True, False):
        mock = simulate(scenario("nadir").but({"seconds": 5.0, "seed": 3}))
        companion = Waking(unix_minus_host_s=mock.unix_minus_host_s)
        companion.pipeline.target_log.written = written
        for _ in mock.drive(companion):
            pass
        companion.finish()
        flown.append((companion.pipeline.target_log.summary(), companion.wakes))
    (counts, wakes), (counts_without, wakes_without) = flown
    assert counts_without == counts
    assert counts.fixes > 20
    assert wakes_without < wakes - 20
