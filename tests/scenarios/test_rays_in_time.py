"""From attitudes and late frames to rays and estimates: numbered troubles, each with the bound that then holds."""

from __future__ import annotations

from math import hypot, sqrt
from typing import Any

import pytest
from draws import first_of
from flying import Flight, fly
from timed_flights import CALM, GLOBAL_SHUTTER, budgets, miss_m, seen

from fwav_companion.recording.line_types import SightingLine
from sitl_mock import TargetOptions, scenario

# 2xx: from attitudes to rays.

NADIR = {
    "seconds": 15.0,
    "flight.pattern": "hover",
    "flight.pitch_deg": 0.0,
    "flight.height_m": 10.0,
    "flight.wander_m": 0.0,
    "flight.wander_deg": 0.0,
    "flight.heave_m": 0.0,
    "flight.flapping_roll_deg": 5.0,
    "targets": (TargetOptions(north=0.7, east=0.9),),
}
"""At nadir from 10 m, 5 deg at 5 Hz about two axes, no noise, rates behind a filter of 20 Hz."""
PERFECT_CLOCK = {"autopilot.attitude_on_whole_ms": True, "camera.stamp_clock": "time_boot"}


def nadir_mm(differences: dict[str, Any], *settings: str) -> float:
    """RMS of the worse axis on the ground, mm: where the ray of each sighting meets the ground, seen from the true
    place.
    """
    options = scenario("perfect").but({**NADIR, **differences})
    readout_s = f"camera.readout_s={options.camera.readout_s}"
    flown = fly(options, (readout_s, *settings), sightings=True)
    late = [line for line in budgets(flown) if flown.mock.camera.row0_s(line.frame) > 6.0]
    errors = [on_the_ground(flown, line) for line in late]
    assert len(errors) > 200
    return 1000.0 * sqrt(max(sum(error[axis] ** 2 for error in errors) for axis in (0, 1)) / len(errors))


def on_the_ground(flown: Flight, line: SightingLine) -> tuple[float, float]:
    """North and east by which a sighting's ray, seen from the true place, misses the target on the ground."""
    camera, target = flown.mock.camera, flown.mock.scene[0]
    _, t = camera.true_pixel(target, camera.row0_s(line.frame))
    place, true, ray = flown.mock.flight.at(t).position, target.at(t), line.ray_ned
    reach = (true[2] - place[2]) / ray[2]
    return (place[0] + reach * ray[0] - true[0], place[1] + reach * ray[1] - true[1])


MOST_MM = {100: 0.5, 50: 3.0, 25: 20.0}


@pytest.mark.parametrize(
    "hz_and_readout", first_of((50, 0.03), (25, 0.0), (100, 0.0), (100, 0.03), (50, 0.0), (25, 0.03), few=2)
)
def test_201_what_pairing_adds_with_a_perfect_clock(hz_and_readout):
    """The stamps are synchronous with the attitudes, which the attitudes show: no configuration is needed."""
    hz, readout_s = hz_and_readout
    assert nadir_mm({**PERFECT_CLOCK, "camera.readout_s": readout_s}, f"rates.attitude={hz}") < MOST_MM[hz]


@pytest.mark.parametrize("delay_s", first_of(0.001, 0.0))
def test_202_the_same_with_the_delay_of_stamps_configured(delay_s):
    """With no delay, and with one whose mean cancels that of cutting stamps to milliseconds."""
    delay = f"uncertainty.attitude_stamp_delay_s={delay_s}"
    assert nadir_mm(PERFECT_CLOCK, "rates.attitude=50", delay) < 3.0


@pytest.mark.parametrize("hz", first_of(50, 100))
def test_203_with_cut_stamps_their_delay_and_the_estimated_clock(hz):
    jitter = {"downlink.jitter_s": 0.003, "uplink.jitter_s": 0.003}
    assert nadir_mm(jitter, f"rates.attitude={hz}") < 20.0


@pytest.mark.parametrize("trouble", first_of({"has_quaternion": False}, {"knows_set_message_interval": False}))
def test_204_attitude_alone_has_its_pitch_trim_put_back(trouble):
    """5 degrees that ArduPlane takes off: 0.87 m from 10 m."""
    differences = {f"autopilot.{name}": value for name, value in trouble.items()}
    assert nadir_mm({"autopilot.pitch_trim_deg": 5.0, **differences}) < 20.0


def test_205_a_stream_too_slow_for_the_motion_says_so_and_carries_it():
    """Ten attitudes a second do not show a wing beat of 5 Hz; the rates that come with them do."""
    options = scenario("perfect").but({**NADIR, "camera.readout_s": 0.0})
    flown = fly(options, (*GLOBAL_SHUTTER, "rates.attitude=10"), sightings=True)
    assert flown.companion.pipeline.status(flown.mock.end_ns).telemetry.too_slow_for_motion
    ratios = []
    for line in budgets(flown):
        north, east = on_the_ground(flown, line)
        ratios.append(hypot(north, east) / line.budget.attitude)
    assert sqrt(sum(ratio**2 for ratio in ratios) / len(ratios)) < 1.5


# 3xx: frames.


@pytest.mark.parametrize(
    ("name", "most_m"),
    [
        ("perfect", 1e-4),
        pytest.param("rolling_shutter", 5e-3, marks=pytest.mark.slow),
        pytest.param("unbiased", 5e-3, marks=pytest.mark.slow),
    ],
)
def test_301_frames_300_ms_late_leave_the_final_estimate_as_in_time(name, most_m):
    """A late frame may find a position behind it where one in time had to go on from the last: with noise in the
    positions that is worth some millimetres of its own fix, and of the estimate one or two."""
    changes = {"seconds": 18.0, "camera.stops_at_s": 16.0, "camera.readout_s": 0.03 if "shutter" in name else 0.0}
    in_time, late = (seen(name, **changes, **{"camera.late_every": every}) for every in (0, 7))
    assert late.companion.lines[-1].fixes == in_time.companion.lines[-1].fixes
    for axis in ("north", "east", "down"):
        assert getattr(late.final(), axis) == pytest.approx(getattr(in_time.final(), axis), abs=most_m)


def test_302_an_unknown_readout_is_uncertainty():
    """The mock's is 30 ms, all of a frame interval; half of one is assumed."""
    known, unknown = (
        fly(
            scenario("rolling_shutter").but({**CALM, "camera.readout_s": 0.03, "camera.fps": 30.0, "seconds": 10.0}),
            (f"camera.readout_s={readout}",),
            sightings=True,
        )
        for readout in ("0.03", '"unknown"')
    )
    claims = [sum(line.budget.time for line in budgets(flown)) / len(budgets(flown)) for flown in (known, unknown)]
    assert claims[1] > claims[0]
    assert miss_m(known) < 0.05
    assert miss_m(unknown) < 0.2
