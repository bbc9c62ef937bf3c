"""Flights whose timing is troubled, and their errors against the mock's own clock, state and scene.

The mock flies, the whole companion listens. In every flight here the hard bound of the clock is checked at every line
of it (``fly_and_bound``).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import cos, hypot, radians
from typing import Any, NamedTuple

from flying import Flight, fly

from fwav_companion.recording.line_types import ClockEstimateLine, SightingLine
from sitl_mock import scenario
from sitl_mock.clock import BootClock, SimulatorTime

CALM = {
    "draw_biases": False,
    "camera.missed": 0.0,
    "camera.clutter": 0.0,
    "camera.readout_s": 0.0,
    "camera.fps": 10.0,
    "seconds": 23.0,
    "seed": 3,
}
"""Noise without bias: the remaining error is the trouble of the scenario."""
NO_BIASES = tuple(
    f"uncertainty.{key}=0.0"
    for key in (
        *("attitude_bias_deg", "heading_bias_deg", "mount_bias_deg", "height_bias_m", "lever_arm_sigma_m"),
        *("position_bias_m", "position_delay_sigma_s"),
    )
)
"""The configuration knows it, so that estimates weigh fixes by their noise."""
GLOBAL_SHUTTER = ("camera.readout_s=0.0", *NO_BIASES)
SETTLED_S = 20.0
"""Time of a flight from which its clock is judged."""
MS = 1e-3


class ClockError(NamedTuple):
    """One line of the clock, against the mock's."""

    flight_s: float
    error_s: float
    sigma_s: float
    bound_s: float
    status: str


def clock_errors(flown: Flight) -> list[ClockError]:
    """Errors of the clock's lines after the last reboot: a rebooted autopilot had another clock before."""
    options, mock = flown.options, flown.mock
    boot_ns = round(options.autopilot.boot_at_start_s * 1e9)
    time = SimulatorTime(options.autopilot.clock_rate, options.autopilot.clock_slips)
    before = BootClock(mock.start_host_ns, boot_ns, options.autopilot.drift_ppm, time)
    reboot_s = min(options.others.reboots_at_s, default=float("inf"))
    errors = []
    for line in flown.companion.lines:
        if isinstance(line, ClockEstimateLine):
            host_ns = round(line.time_monotonic * 1e9)
            at_s = mock.flight_s(host_ns)
            clock = before if at_s < reboot_s + options.others.reboot_takes_s else mock.clock
            true_s = (host_ns - clock.boot_ns(host_ns)) * 1e-9
            error_s = line.host_from_autopilot_s - true_s
            errors.append(ClockError(at_s, error_s, line.sigma_s, line.bound_s, line.status))
    return errors


def fly_and_bound(
    name: str, differences: dict[str, Any], settings: Sequence[str] = (), *, sightings: bool = False
) -> Flight:
    options = scenario(name).but({**CALM, **differences})
    flown = fly(options, (f"camera.readout_s={options.camera.readout_s}", *NO_BIASES, *settings), sightings=sightings)
    reboots = flown.options.others.reboots_at_s
    for line in clock_errors(flown):
        if not any(at < line.flight_s < at + flown.options.others.reboot_takes_s + 1.0 for at in reboots):
            assert abs(line.error_s) <= line.bound_s, line
    return flown


@cache
def seen(name: str, *how: str, **differences: Any) -> Flight:
    """A flight of a scenario; several tests use the same one."""
    return fly_and_bound(name, differences, sightings="sightings" in how)


def worst_s(flown: Flight, after_s: float = SETTLED_S) -> float:
    return max(abs(line.error_s) for line in clock_errors(flown) if line.flight_s > after_s)


def miss_m(flown: Flight) -> float:
    """Horizontal error of the last estimate, metres, for any position of the origin."""
    line = flown.final()
    true = flown.mock.world.place(flown.mock.scene[0].at(0.0))
    north = (line.lat - true.lat) * 111_200.0
    return hypot(north, (line.lon - true.lon) * 111_200.0 * cos(radians(true.lat)))


def held_back(flown: Flight) -> dict[str, int]:
    reasons = {"before_history", "no_clock", "stale_attitude", "attitude_gap", "from_the_future", "too_late"}
    dropped, calm = flown.companion.lines[-1].dropped, seen("unbiased").companion.lines[-1].dropped
    return {reason: dropped.get(reason, 0) - calm.get(reason, 0) for reason in reasons}


def budgets(flown: Flight) -> list[SightingLine]:
    return [line for line in flown.companion.lines if isinstance(line, SightingLine) and line.budget]
