"""One line of time from 32-bit stamps: wraps, disorder, stalls, reboots, and single wild stamps."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.telemetry.clock.boot_time import WRAP_NS, BootTimeline, Restarted, Skipped, Strange

MS = 1_000_000
S = 1000 * MS


def after(*reported: tuple[int, float]) -> BootTimeline:
    """A timeline that has placed (time_boot_ms, arrival in seconds)."""
    timeline = BootTimeline()
    for boot_ms, arrival_s in reported:
        timeline.place(boot_ms, HostNs(round(arrival_s * 1e9)))
    return timeline


def test_it_goes_on_past_the_wrap():
    timeline = after((2**32 - 20, 100.0))
    assert timeline.place(2**32 - 10, HostNs(100_010 * MS)) == (2**32 - 10) * MS
    assert timeline.place(5, HostNs(100_025 * MS)) == WRAP_NS + 5 * MS
    assert timeline.place(2**32 - 5, HostNs(100_026 * MS)) == (2**32 - 5) * MS  # disorder across the wrap


def test_disorder_is_no_reboot():
    timeline = after((5000, 10.0), (5100, 10.1))
    assert timeline.place(4300, HostNs(10_110 * MS)) == 4300 * MS
    assert timeline.newest_ns == 5100 * MS


def test_a_reboot_takes_three_stamps_in_agreement_over_a_fifth_of_a_second():
    timeline = after((60_000, 70.0))
    assert timeline.place(2000, HostNs(75 * S)) == Strange()
    assert timeline.place(2190, HostNs(75_190 * MS)) == Strange()
    assert timeline.place(2195, HostNs(75_195 * MS)) == Strange()
    assert timeline.place(2200, HostNs(75_200 * MS)) == Restarted(2200 * MS)
    assert timeline.place(2210, HostNs(75_210 * MS)) == 2210 * MS


def test_late_copies_of_many_messages_are_no_reboot():
    """A router sends twenty old messages in one burst, and the stream goes on."""
    timeline = after((60_000, 70.0))
    copies = [timeline.place(50_000 + 20 * k, HostNs(70 * S + k * MS)) for k in range(20)]
    assert copies == [Strange()] * 20
    assert timeline.place(60_100, HostNs(70_100 * MS)) == 60_100 * MS


def test_stamps_that_stay_ahead_are_no_reboot():
    """The host slept for a minute, which its monotonic clock does not count: the line goes on, a minute ahead."""
    timeline = after((60_000, 70.0))
    placed = [timeline.place(120_100 + 100 * k, HostNs(70_100 * MS + 100 * k * MS)) for k in range(3)]
    assert placed == [Strange(), Strange(), Skipped(120_300 * MS, 60 * S)]
    assert timeline.place(120_400, HostNs(70_400 * MS)) == 120_400 * MS


@pytest.mark.parametrize("slipped_ms", [77, 500, 3000])
def test_a_clock_that_falls_behind_is_no_reboot(slipped_ms):
    timeline = after((60_000, 70.0))
    placed = [timeline.place(60_100 + 100 * k, HostNs((70_100 + slipped_ms + 100 * k) * MS)) for k in range(10)]
    assert placed == [(60_100 + 100 * k) * MS for k in range(10)]


def test_a_reboot_after_weeks_is_no_jump_ahead():
    """30 days back equals 19.7 days ahead, modulo a wrap."""
    thirty_days_ms = 30 * 86_400_000
    timeline = after((thirty_days_ms, 10.0))
    assert [timeline.place(1000 + 100 * k, HostNs(20 * S + 100 * k * MS)) for k in range(3)][2] == Restarted(1200 * MS)


def test_a_slow_second_link_is_no_reboot():
    timeline = after((10_000, 20.0))
    for k in range(20):
        fresh, old = 10_010 + 10 * k, 8_000 + 10 * k
        assert timeline.place(fresh, HostNs(20 * S + (10 + 10 * k) * MS)) == fresh * MS
        assert timeline.place(old, HostNs(20 * S + (11 + 10 * k) * MS)) == Strange()


def test_wild_stamps_that_disagree_are_no_reboot():
    timeline = after((10_000, 20.0))
    for wild in (1, 4_000_000_000, 77_000_000, 5, 3_000_000_000):
        assert timeline.place(wild, HostNs(20 * S)) == Strange()
    assert timeline.place(10_010, HostNs(20_010 * MS)) == 10_010 * MS


def test_a_link_that_held_back_five_seconds_is_no_reboot():
    timeline = after((10_000, 20.0))
    assert [timeline.place(10_000 + 100 * k, HostNs(25 * S)) for k in range(1, 50)][-1] == 14_900 * MS


def test_timesync_shows_weeks_that_stamps_wrapped_away():
    timeline = BootTimeline()
    full_ns = WRAP_NS + 7 * S
    assert timeline.align(full_ns, HostNs(50 * S)) == full_ns
    assert timeline.place(7_010, HostNs(50_010 * MS)) == full_ns + 10 * MS
    other = after((7_000, 50.0))
    assert other.align(full_ns + 20 * MS, HostNs(50_020 * MS)) == 7_020 * MS


@given(st.lists(st.integers(0, 2**32 - 1), max_size=30), st.lists(st.integers(0, 10**12), max_size=30))
def test_any_stamps_are_placed_or_refused(stamps, arrivals):
    timeline = BootTimeline()
    for boot_ms, arrival_ns in zip(stamps, arrivals, strict=False):
        placed = timeline.place(boot_ms, HostNs(arrival_ns))
        assert isinstance(placed, int | Strange | Restarted | Skipped)
        if isinstance(placed, int):
            assert placed % MS == 0
            assert (placed - boot_ms * MS) % WRAP_NS == 0


@pytest.mark.parametrize("gap_s", [3.0, 60.0, 3600.0])
def test_silence_is_no_reboot(gap_s):
    timeline = after((10_000, 20.0))
    boot_ms = 10_000 + round(gap_s * 1e3)
    assert timeline.place(boot_ms, HostNs(round((20.0 + gap_s) * 1e9))) == boot_ms * MS


class Asked(BootTimeline):
    """The time line that asks every question of every stamp."""

    __slots__ = ()

    def place(self, time_boot_ms: int, arrival_ns: HostNs):
        placed = self.align(time_boot_ms * 1_000_000, arrival_ns)
        if isinstance(placed, int):
            self._advance(placed, arrival_ns)
        return placed


@given(
    start_ms=st.sampled_from([0, 5, 60_000, 2**32 - 400]),
    steps=st.lists(
        st.tuples(
            st.sampled_from([0, 1, 10, 10, 10, 100, 6_000, 20_000]),
            st.sampled_from([-1, 0, 0, 0, 3, -500, -2_000, 9_000, 11_000, -70_000]),
        ),
        max_size=60,
    ),
)
def test_a_stamp_that_is_placed_at_once_is_placed_as_by_all_questions(start_ms: int, steps: list[tuple[int, int]]):
    """``steps``: milliseconds that pass, and how far the stamp is off."""
    quick, asked = BootTimeline(), Asked()
    elapsed_ms = 0
    for passed_ms, off_ms in steps:
        elapsed_ms += passed_ms
        stamp_ms, arrival_ns = (start_ms + elapsed_ms + off_ms) % 2**32, HostNs(elapsed_ms * 1_000_000)
        assert quick.place(stamp_ms, arrival_ns) == asked.place(stamp_ms, arrival_ns)
        assert quick.newest_ns == asked.newest_ns
