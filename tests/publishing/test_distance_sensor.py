"""DISTANCE_SENSOR from the size of a tag: when it is sent, what it says, and that an echo of it is recognised."""

from math import cos, radians, sin
from types import SimpleNamespace

import pytest
from msgspec import structs

from fwav_companion.publishing.distance_sensor import SENSOR_ID, TagRange
from fwav_companion.types import Destination, SizeHeight

S = 10**9


def tilted(degrees):
    """A unit ray of the camera, so many degrees from straight down."""
    return (sin(radians(degrees)), 0.0, cos(radians(degrees)))


def seen(world, *, height_m=5.0, noise_m=0.03, off_deg=5.0, at=None, **state):
    at = world.NOW if at is None else at
    fix = world.fix(at=at, ray=tilted(off_deg))
    sighting = structs.replace(
        fix.sighting, size_height=SizeHeight(height_m, noise_m, 0.01), state=world.state(at, **state)
    )
    return world.track(at=at, fix=structs.replace(fix, best_height_m=7.0, sighting=sighting))


def message(cm, orientation=25, low=5, high=5000):
    """Fields of the autopilot's message."""
    return SimpleNamespace(current_distance=cm, orientation=orientation, min_distance=low, max_distance=high)


@pytest.fixture
def ranges():
    return TagRange((0.0, 0.0, 0.1), 191)


def test_range_is_that_of_the_tags_size_to_the_vehicles_origin_along_its_own_axis(world, ranges):
    """Never the best height, in which the autopilot's own is: 5 m by the size, the camera 0.1 m low, 10 deg of roll."""
    track = seen(world, q=world.quaternion(roll_deg=10.0))
    out = ranges.on_tracks((track,), world.situation())
    got = world.packed(out)
    assert (out.to, out.component) == (Destination.AUTOPILOT, 191)
    assert got["current_distance"] == round(100.0 * (5.0 / cos(radians(10.0)) + 0.1))
    assert (got["orientation"], got["id"]) == (25, SENSOR_ID)
    assert got["covariance"] == pytest.approx((3.0**2 + 5.0**2) / cos(radians(10.0)) ** 2, abs=0.6)
    assert got["min_distance"] < got["current_distance"] < got["max_distance"]
    assert 2 <= got["signal_quality"] <= 100
    assert got["time_boot_ms"] == track.fix.sighting.boot_ns // 1_000_000


@pytest.mark.parametrize(
    "changes",
    [{"off_deg": 16.0}, {"noise_m": 0.17}, {"height_m": 60.0, "noise_m": 0.01}],
    ids=["far off the vertical", "beyond the message's covariance", "beyond its range"],
)
def test_range_that_it_may_not_say_is_not_sent(world, ranges, changes):
    assert ranges.on_tracks((seen(world),), world.situation()) is not None
    later = world.NOW + S
    track = seen(world, at=later, **changes)
    assert ranges.on_tracks((track,), world.situation(later)) is None


def test_range_is_not_sent_without_a_tag_of_known_size_in_the_frame(world, ranges):
    assert ranges.on_tracks((world.track(), world.track(with_fix=False)), world.situation()) is None


def test_ranges_come_at_least_four_and_at_most_twenty_times_a_second(world, ranges):
    for fps, least, most in ((30, 15, 20), (5, 5, 5)):
        times = [world.NOW + (40 - fps) * S + round(k * S / fps) for k in range(fps)]
        sent = [ranges.on_tracks((seen(world, at=at),), world.situation(at)) for at in times]
        assert least <= sum(each is not None for each in sent) <= most


def test_own_range_that_comes_back_is_recognised_and_does_not_silence(world, ranges):
    ranges.on_tracks((seen(world),), world.situation())
    echo = 510
    assert ranges.is_ours(message(echo), world.NOW + S // 10)
    assert ranges.returned == 1
    later = world.NOW + S // 2
    assert ranges.on_tracks((seen(world, at=later),), world.situation(later)) is not None
    assert not ranges.is_ours(message(echo), later + 2 * S)  # a second later it is none of ours


def test_real_rangefinder_that_looks_down_silences_ours(world, ranges):
    ranges.is_ours(message(430), world.NOW)
    assert ranges.on_tracks((seen(world),), world.situation()) is None
    later = world.NOW + 6 * S
    assert ranges.on_tracks((seen(world, at=later),), world.situation(later)) is not None


@pytest.mark.parametrize("other", [message(430, orientation=0), message(0), message(5000)])
def test_sensor_that_looks_ahead_or_reads_nothing_does_not_silence_ours(world, ranges, other):
    assert not ranges.is_ours(other, world.NOW)
    assert ranges.on_tracks((seen(world),), world.situation()) is not None


def test_recorded_range_of_ours_is_recognised_in_a_replay(ranges):
    ranges.on_own(512, 0)
    assert ranges.is_ours(message(512), S // 2)
