"""The smoother's clock over reboots of the autopilot, by itself and in a flight."""

import pytest
from flying import fly
from timed_flights import CALM, NO_BIASES, miss_m

from fwav_companion.geometry.stamps import NS_PER_S, BootNs, HostNs
from fwav_companion.tracking.smoothed.flight_clock import FlightClock
from fwav_companion.tracking.smoothed.solve_jobs import SmootherOptions
from sitl_mock import scenario


def at(seconds):
    return round(seconds * NS_PER_S)


def followed(*captures):
    """The clock after captures, each seconds on the autopilot's and the host's clock; what it said of them."""
    clock = FlightClock()
    added_ns, reboots = zip(*[clock.follow(BootNs(at(boot)), HostNs(at(host))) for boot, host in captures], strict=True)
    return clock, added_ns, list(reboots)


def test_stamps_without_a_reboot_are_left_as_they_are():
    clock, _, reboots = followed((100.0, 7.0), (100.1, 7.1), (160.2, 67.1))
    assert reboots == [False] * 3
    assert clock.seconds(BootNs(at(160.2))) == pytest.approx(160.2, abs=1e-12)


def test_time_goes_on_by_the_hosts_clock_after_a_reboot_and_after_a_second_one():
    clock, _, reboots = followed((100.0, 7.0), (2.0, 10.0), (3.0, 11.0), (1.0, 14.0))
    assert reboots == [False, True, False, True]
    assert clock.seconds(BootNs(at(1.0))) == pytest.approx(107.0)


def test_late_frame_from_before_the_reboot_keeps_the_stamps_of_its_boot():
    _, added_ns, reboots = followed((100.0, 7.0), (2.0, 10.0), (100.1, 7.1), (2.1, 10.1))
    assert reboots == [False, True, False, False]
    assert added_ns == (0, at(101.0), 0, at(101.0))


def test_target_keeps_its_track_and_its_place_over_a_reboot():
    options = scenario("rebooting").but(CALM)
    settings = (f"camera.readout_s={options.camera.readout_s}", *NO_BIASES)
    flown = fly(options, settings, smoother=SmootherOptions())
    confirmed = [line for line in flown.companion.targets() if line.state == "confirmed"]
    assert len({line.track for line in confirmed}) == 1
    assert flown.seen_at_s(confirmed[-1]) > 16.0
    assert miss_m(flown) < 0.05
