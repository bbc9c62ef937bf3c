"""The wall clock and its steps, with invented times. Truth first: when a frame was captured, and what was stamped."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.types import NoFrame, Reason
from fwav_companion.vision.wall_clock import STEPS_KEPT, ClockStep, WallClock

UNIX = 1_790_000_000_000_000_000
MS = 1_000_000
S = 1_000_000_000


def stamp(captured_ns: int, unix_minus_host_ns: int) -> float:
    return (captured_ns + unix_minus_host_ns) / 1000 / 1e6


def test_a_stamp_is_placed_to_the_microsecond():
    clock = WallClock(HostNs(0), UNIX)
    assert clock.host_from_unix(stamp(123_456_789_000, UNIX), None) == 123_456_789_000
    assert clock.host_from_monotonic(123.456789) == 123_456_789_000


def test_reading_jitter_is_no_step_and_is_followed():
    clock = WallClock(HostNs(0), UNIX)
    assert clock.observe(HostNs(S), UNIX + S + 40_000) is None
    assert clock.unix_minus_host_ns == UNIX + 40_000


@pytest.mark.parametrize("size_ns", [3600 * S, 20 * MS, -20 * MS, -3600 * S])
def test_a_step_is_reported_once_with_its_size(size_ns: int):
    clock = WallClock(HostNs(0), UNIX)
    step = clock.observe(HostNs(S), UNIX + S + size_ns)
    assert step == ClockStep(HostNs(S), UNIX, UNIX + size_ns)
    assert step.size_s == pytest.approx(size_ns / S)
    assert clock.observe(HostNs(2 * S), UNIX + 2 * S + size_ns) is None


@settings(max_examples=500, derandomize=True)
@given(
    size_us=st.integers(-2_000_000, 2_000_000) | st.integers(-(10**13), 10**13),
    stepped_us=st.integers(0, 100_000),
    captured_us=st.integers(-600_000, 600_000),
    way_us=st.integers(0, 500_000),
)
def test_no_frame_is_placed_wrongly_by_a_step(size_us: int, stepped_us: int, captured_us: int, way_us: int):
    """The clock steps at 10 s minus up to 0.1 s and is seen stepped at 10 s; frames are captured around it."""
    seen, size = 10 * S, size_us * 1000
    if abs(size) < MS:
        return
    stepped, captured = seen - stepped_us * 1000, seen + captured_us * 1000
    arrival = HostNs(captured + way_us * 1000)
    if arrival < seen:
        return
    clock = WallClock(HostNs(0), UNIX)
    clock.observe(HostNs(seen - 101 * MS), UNIX + seen - 101 * MS)
    clock.observe(HostNs(seen), UNIX + seen + size)
    unix_minus_host = UNIX + (size if captured >= stepped else 0)
    placed = clock.host_from_unix(stamp(captured, unix_minus_host), arrival)
    assert isinstance(placed, NoFrame) or placed == captured


@pytest.mark.parametrize("size_ns", [3600 * S, -3600 * S, 3 * S, -3 * S])
def test_after_the_longest_way_every_frame_is_taken_again(size_ns: int):
    clock = WallClock(HostNs(0), UNIX)
    clock.observe(HostNs(10 * S), UNIX + 10 * S + size_ns)
    for age_ms in range(600, 5000, 50):
        captured = 10 * S + age_ms * MS
        assert clock.host_from_unix(stamp(captured, UNIX + size_ns), HostNs(captured + 30 * MS)) == captured


@pytest.mark.parametrize("age_ms", [20, 400, 700, 5000])
@pytest.mark.parametrize("size_ms", [3000, 20])
def test_a_stamp_from_before_a_step_is_refused_by_name(age_ms: int, size_ms: int):
    clock = WallClock(HostNs(0), UNIX)
    clock.observe(HostNs(10 * S), UNIX + 10 * S + size_ms * MS)
    refused = clock.host_from_unix(stamp(10 * S - age_ms * MS, UNIX), HostNs(10 * S + 10 * MS))
    assert refused == NoFrame(Reason.ACROSS_CLOCK_STEP, f"the wall clock was set by +{size_ms / 1000:.3f} s")


def test_many_steps_are_remembered_within_bounds():
    clock = WallClock(HostNs(0), UNIX)
    for i in range(1000):
        clock.observe(HostNs(i * MS), UNIX + i * MS + i * S)
    assert len(clock._steps) == STEPS_KEPT
