"""Time, end to end: numbered troubles of clock, stamps, pairing and rates, each with the bound that then holds.

The mock flies, the whole companion listens; the mock's own clock, state and scene are the truth. In every flight here
the hard bound of the clock is checked at every line of it (``fly_and_bound``).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import cos, hypot
from typing import Any, NamedTuple

import pytest
from flying import Flight, fly

from sitl_mock import scenario
from sitl_mock.clock import BootClock

CALM = {
    "draw_biases": False,
    "camera.missed": 0.0,
    "camera.clutter": 0.0,
    "camera.readout_s": 0.0,
    "seconds": 24.0,
    "seed": 3,
}
"""Noise, but no bias: what is left is the trouble of the scenario."""
GLOBAL_SHUTTER = ("camera.readout_s=0.0",)
SETTLED_S = 20.0
WRAP_S = 2**32 / 1000.0


class ClockError(NamedTuple):
    """One line of the clock, against the mock's."""

    flight_s: float
    error_s: float
    sigma_s: float
    bound_s: float
    status: str


def clock_errors(flown: Flight) -> list[ClockError]:
    """A rebooted autopilot had another clock before."""
    options, mock = flown.options, flown.mock
    boot_ns = round(options.autopilot.boot_at_start_s * 1e9)
    before = BootClock(mock.start_host_ns, boot_ns, options.autopilot.drift_ppm)
    reboot_s = min(options.others.reboots_at_s, default=float("inf"))
    errors = []
    for line in flown.companion.lines:
        if line["type"] == "clock":
            host_ns = round(line["time_monotonic"] * 1e9)
            at_s = mock.flight_s(host_ns)
            clock = before if at_s < reboot_s + options.others.reboot_takes_s else mock.clock
            true_s = (host_ns - clock.boot_ns(host_ns)) * 1e-9
            error_s = line["host_from_autopilot_s"] - true_s
            errors.append(ClockError(at_s, error_s, line["sigma_s"], line["bound_s"], line["status"]))
    return errors


def fly_and_bound(name: str, differences: dict[str, Any], settings: Sequence[str] = GLOBAL_SHUTTER) -> Flight:
    flown = fly(scenario(name).but({**CALM, **differences}), settings)
    reboots = flown.options.others.reboots_at_s
    for line in clock_errors(flown):
        if not any(at < line.flight_s < at + flown.options.others.reboot_takes_s + 1.0 for at in reboots):
            assert abs(line.error_s) <= line.bound_s, line
    return flown


def worst_s(flown: Flight, after_s: float = SETTLED_S) -> float:
    return max(abs(line.error_s) for line in clock_errors(flown) if line.flight_s > after_s)


def miss_m(flown: Flight) -> float:
    """Of the last estimate, horizontally, wherever the origin came to lie."""
    line = flown.final()
    true = flown.mock.world.place(flown.mock.scene[0].at(0.0))
    north = (line["lat"] - true.lat) * 111_200.0
    return hypot(north, (line["lon"] - true.lon) * 111_200.0 * cos(true.lat * 3.14159265 / 180.0))


@cache
def untroubled() -> Flight:
    """What the troubled flights are compared with."""
    return fly_and_bound("unbiased", {})


# 1xx: the clock. (trouble, scenario, difference, worst error of the clock after 20 s, worst miss of the target)

MS = 1e-3
CLOCK = [
    (101, "10 ms exponential jitter each way", "jitter_10ms", {}, 1.0 * MS, 0.10),
    (102, "the same, and 600 ppm fast", "jitter_10ms", {"autopilot.drift_ppm": 600.0}, 1.0 * MS, 0.10),
    (103, "the same, and 600 ppm slow", "jitter_10ms", {"autopilot.drift_ppm": -600.0}, 1.0 * MS, 0.10),
    (104, "600 ppm on a quiet wire", "unbiased", {"autopilot.drift_ppm": 600.0}, 0.05 * MS, 0.05),
    (105, "5 ms up and 25 ms down: half the difference, unseen", "asymmetric", {}, 10.1 * MS, 0.10),
    (106, "answers up to 20 ms late", "unbiased", {"autopilot.poll_delay_s": 0.02}, 1.0 * MS, 0.10),
    (
        107,
        "a wrap of the milliseconds at 12 s",
        "unbiased",
        {"autopilot.boot_at_start_s": WRAP_S - 12},
        0.05 * MS,
        0.05,
    ),
    (108, "another computer answers every TIMESYNC", "foreign_timesync", {}, 0.1 * MS, 0.05),
    (109, "a second vehicle on the link", "two_vehicles", {}, 0.05 * MS, 0.05),
    (110, "TIMESYNC is never answered", "silent_clock", {}, 2.0 * MS, 0.05),
    (111, "one frame in ten is lost", "lossy_wire", {}, 0.05 * MS, 0.05),
    (112, "one frame in ten is damaged", "corrupted_wire", {}, 0.05 * MS, 0.05),
    (113, "byte by byte: the way down takes longer", "byte_by_byte", {}, 0.5 * MS, 0.05),
    (114, "nothing comes from 8 s to 13 s", "silence", {}, 0.05 * MS, 0.05),
    (115, "the wall clock steps by an hour", "stepped_wall_clock", {}, 0.05 * MS, 0.05),
    (116, "a reboot in flight at 12 s", "rebooting", {}, 0.1 * MS, 0.05),
    (117, "PX4, whose own requests come ten a second", "px4", {}, 0.05 * MS, 0.05),
]


@pytest.mark.parametrize(
    ("name", "differences", "clock_s", "target_m"), [row[2:] for row in CLOCK], ids=[f"{n} {t}" for n, t, *_ in CLOCK]
)
def test_clock(name, differences, clock_s, target_m):
    settings = (*GLOBAL_SHUTTER, "vehicle.system_id=1") if name == "two_vehicles" else GLOBAL_SHUTTER
    flown = fly_and_bound(name, differences, settings)
    print(name, worst_s(flown) * 1e3, miss_m(flown))
    assert worst_s(flown) < clock_s
    assert miss_m(flown) < target_m
