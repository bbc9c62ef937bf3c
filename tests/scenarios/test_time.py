"""Time, end to end: numbered troubles of clock, stamps, pairing and rates, each with the bound that then holds.

The mock flies, the whole companion listens; the mock's own clock, state and scene are the truth. In every flight here
the hard bound of the clock is checked at every line of it (``fly_and_bound``).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import cache
from math import cos, hypot, radians, sqrt
from typing import Any, NamedTuple

import pytest
from flying import Flight, fly

from fwav_companion.types import NoticeCode
from sitl_mock import TargetOptions, scenario
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
WRAP_S = 2**32 / 1000.0


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
        if line["type"] == "clock":
            host_ns = round(line["time_monotonic"] * 1e9)
            at_s = mock.flight_s(host_ns)
            clock = before if at_s < reboot_s + options.others.reboot_takes_s else mock.clock
            true_s = (host_ns - clock.boot_ns(host_ns)) * 1e-9
            error_s = line["host_from_autopilot_s"] - true_s
            errors.append(ClockError(at_s, error_s, line["sigma_s"], line["bound_s"], line["status"]))
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
    north = (line["lat"] - true.lat) * 111_200.0
    return hypot(north, (line["lon"] - true.lon) * 111_200.0 * cos(radians(true.lat)))


# 1xx: the clock. (trouble, scenario, difference, worst error of the clock after 20 s, worst miss of the target)

MS = 1e-3
CLOCK = [
    (101, "10 ms exponential jitter each way", "jitter_10ms", {}, 2.0 * MS, 0.10),
    (102, "the same, and 600 ppm fast", "jitter_10ms", {"autopilot.drift_ppm": 600.0}, 2.0 * MS, 0.10),
    (103, "the same, and 600 ppm slow", "jitter_10ms", {"autopilot.drift_ppm": -600.0}, 2.0 * MS, 0.10),
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
    flown = (
        fly_and_bound(name, differences, ["vehicle.system_id=1"])
        if name == "two_vehicles"
        else seen(name, **differences)
    )
    assert worst_s(flown) < clock_s
    assert miss_m(flown) < target_m


@pytest.mark.parametrize(
    ("name", "differences"),
    [
        ("foreign_timesync", {}),
        ("rebooting", {}),
        ("stepped_wall_clock", {}),
        ("unbiased", {"camera.stamp_clock": "time_boot"}),
        ("unbiased", {"camera.stamp_clock": "time_unix"}),
        ("unbiased", {"autopilot.boot_at_start_s": WRAP_S - 12.0, "camera.stamp_clock": "time_boot"}),
    ],
    ids=["foreign speaker", "reboot", "wall clock", "stamps by the autopilot", "stamps by the wall", "wrapping stamps"],
)
def test_118_what_leaves_the_error_where_it_was(name, differences):
    """Against the same flight without the trouble: estimate and clock stay within the effect of other noise."""
    calm, troubled = seen("unbiased"), seen(name, **differences)
    assert miss_m(troubled) < miss_m(calm) + 0.01
    assert worst_s(troubled) < worst_s(calm) + 0.05 * MS
    assert troubled.companion.lines[-1]["fixes"] > 0.7 * calm.companion.lines[-1]["fixes"]


def test_119_a_reboot_is_reported_and_frames_meanwhile_are_held_back():
    flown = seen("rebooting")
    assert flown.companion.codes.count(NoticeCode.AUTOPILOT_REBOOTED) == 1
    assert flown.companion.pipeline.status(flown.mock.end_ns).telemetry.reboots == 1
    assert 15 < sum(held_back(flown).values()) < 35  # two seconds of ten frames, and the new clock's first
    after = [line for line in clock_errors(flown) if line.flight_s > 15.5]
    assert all(abs(line.error_s) < 1.0 * MS for line in after)


@pytest.mark.parametrize("stamp_clock", ["time_monotonic", "time_boot"])
def test_122_slips_of_a_simulator_are_followed_and_cost_no_frame(stamp_clock):
    """Five pauses of 15 to 170 ms: no reboot, nothing lost, the first one is reported."""
    options = scenario("clock_slips").but({**CALM, "camera.stamp_clock": stamp_clock})
    flown, calm = fly(options, GLOBAL_SHUTTER), seen("unbiased", **{"camera.stamp_clock": stamp_clock})
    assert NoticeCode.AUTOPILOT_REBOOTED not in flown.companion.codes
    assert 1 <= flown.companion.codes.count(NoticeCode.CLOCK_SLIPPED) <= 5
    assert flown.companion.pipeline.status(flown.mock.end_ns).telemetry.reboots == 0
    lost = Counter(flown.companion.lines[-1]["dropped"]) - Counter(calm.companion.lines[-1]["dropped"])
    assert lost.total() <= 2
    assert flown.companion.lines[-1]["fixes"] > 0.98 * calm.companion.lines[-1]["fixes"]
    assert miss_m(flown) < miss_m(calm) + 0.03
    slips = [at_s for at_s, _ in options.autopilot.clock_slips]
    for line in clock_errors(flown):
        if not any(0.0 <= line.flight_s - at_s < 1.0 for at_s in slips):
            assert abs(line.error_s) < max(line.bound_s, 2.0 * MS), line


@pytest.mark.parametrize("stamp_clock", ["time_monotonic", "time_boot"])
@pytest.mark.parametrize("rate", [0.6, 0.985, 1.4])
def test_123_a_clock_at_another_rate_is_followed_inside_its_bound(rate, stamp_clock):
    changed = {"autopilot.clock_rate": rate, "camera.stamp_clock": stamp_clock}
    flown, calm = seen("slow_clock", **changed), seen("unbiased")  # the bound is judged in it
    assert flown.companion.codes.count(NoticeCode.CLOCK_RATE) == 1
    assert NoticeCode.AUTOPILOT_REBOOTED not in flown.companion.codes
    assert worst_s(flown, 5.0) < 1.0 * MS
    assert miss_m(flown) < miss_m(calm) + 0.03
    assert flown.companion.lines[-1]["fixes"] > 0.95 * calm.companion.lines[-1]["fixes"]
    rates = [line["rate"] for line in flown.companion.lines if line["type"] == "clock"]
    assert rates[-1] == pytest.approx(rate, abs=2e-3)


def test_120_frames_across_a_step_of_the_wall_clock_are_refused_by_name_and_no_others():
    dropped = seen("stepped_wall_clock").companion.lines[-1]["dropped"]
    calm = seen("unbiased", **{"camera.stamp_clock": "time_unix"}).companion.lines[-1]["dropped"]
    assert 1 <= dropped.pop("across_clock_step") <= 2
    assert dropped == calm


def test_121_an_uncertain_clock_is_reported_and_in_the_covariance_of_fixes():
    """By arrivals alone sigma is 5 ms; the error is the least delay. The same flight with answers claims less."""
    silent, answered = seen("silent_clock", "sightings"), seen("unbiased", "sightings")
    last = clock_errors(silent)[-1]
    assert last.status == "arrivals"
    assert abs(last.error_s) < last.sigma_s == pytest.approx(5.0 * MS, rel=0.1)
    by_time = [
        sqrt(sum(line["budget"]["time"] ** 2 for line in used) / len(used))
        for used in (budgets(silent), budgets(answered))
    ]
    assert by_time[0] > 1.05 * by_time[1]


def held_back(flown: Flight) -> dict[str, int]:
    reasons = {"before_history", "no_clock", "stale_attitude", "attitude_gap", "from_the_future", "too_late"}
    dropped, calm = flown.companion.lines[-1]["dropped"], seen("unbiased").companion.lines[-1]["dropped"]
    return {reason: dropped.get(reason, 0) - calm.get(reason, 0) for reason in reasons}


def budgets(flown: Flight) -> list[dict[str, Any]]:
    return [line for line in flown.companion.lines if line["type"] == "sighting" and line["budget"]]


# 2xx: from attitudes to rays. At nadir from 10 m, 5 deg at 5 Hz about two axes, no noise, rates behind 20 Hz.

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
PERFECT_CLOCK = {"autopilot.attitude_on_whole_ms": True, "camera.stamp_clock": "time_boot"}


def nadir_mm(differences: dict[str, Any], *settings: str) -> float:
    """RMS of the worse axis on the ground, mm: where the ray of each sighting meets the ground, seen from the true
    place.
    """
    options = scenario("perfect").but({**NADIR, **differences})
    readout_s = f"camera.readout_s={options.camera.readout_s}"
    flown = fly(options, (readout_s, *settings), sightings=True)
    late = [line for line in budgets(flown) if flown.mock.camera.row0_s(line["frame"]) > 6.0]
    errors = [on_the_ground(flown, line) for line in late]
    assert len(errors) > 200
    return 1000.0 * sqrt(max(sum(error[axis] ** 2 for error in errors) for axis in (0, 1)) / len(errors))


def on_the_ground(flown: Flight, line: dict[str, Any]) -> tuple[float, float]:
    """North and east by which a sighting's ray, seen from the true place, misses the target on the ground."""
    camera, target = flown.mock.camera, flown.mock.scene[0]
    _, t = camera.true_pixel(target, camera.row0_s(line["frame"]))
    place, true, ray = flown.mock.flight.at(t).position, target.at(t), line["ray_ned"]
    reach = (true[2] - place[2]) / ray[2]
    return (place[0] + reach * ray[0] - true[0], place[1] + reach * ray[1] - true[1])


@pytest.mark.parametrize("readout_s", [0.0, 0.03])
@pytest.mark.parametrize(("hz", "most_mm"), [(100, 0.5), (50, 3.0), (25, 20.0)])
def test_201_what_pairing_adds_with_a_perfect_clock(hz, most_mm, readout_s):
    """The stamps are synchronous with the attitudes, which the attitudes show: no configuration is needed."""
    assert nadir_mm({**PERFECT_CLOCK, "camera.readout_s": readout_s}, f"rates.attitude={hz}") < most_mm


@pytest.mark.parametrize("delay_s", [0.0, 0.001])
def test_202_the_same_with_the_delay_of_stamps_configured(delay_s):
    """With no delay, and with one whose mean cancels that of cutting stamps to milliseconds."""
    delay = f"uncertainty.attitude_stamp_delay_s={delay_s}"
    assert nadir_mm(PERFECT_CLOCK, "rates.attitude=50", delay) < 3.0


@pytest.mark.parametrize("hz", [50, 100])
def test_203_with_cut_stamps_their_delay_and_the_estimated_clock(hz):
    jitter = {"downlink.jitter_s": 0.003, "uplink.jitter_s": 0.003}
    assert nadir_mm(jitter, f"rates.attitude={hz}") < 20.0


@pytest.mark.parametrize("trouble", [{"has_quaternion": False}, {"knows_set_message_interval": False}])
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
        ratios.append(hypot(north, east) / line["budget"]["attitude"])
    assert sqrt(sum(ratio**2 for ratio in ratios) / len(ratios)) < 1.5


# 3xx: frames.


@pytest.mark.parametrize(
    ("name", "most_m"),
    [("perfect", 1e-4), ("unbiased", 5e-3), ("rolling_shutter", 5e-3)],
)
def test_301_frames_300_ms_late_leave_the_final_estimate_as_in_time(name, most_m):
    """A late frame may find a position behind it where one in time had to go on from the last: with noise in the
    positions that is worth some millimetres of its own fix, and of the estimate one or two."""
    changes = {"seconds": 18.0, "camera.stops_at_s": 16.0, "camera.readout_s": 0.03 if "shutter" in name else 0.0}
    in_time, late = (seen(name, **changes, **{"camera.late_every": every}) for every in (0, 7))
    assert late.companion.lines[-1]["fixes"] == in_time.companion.lines[-1]["fixes"]
    for axis in ("north", "east", "down"):
        assert late.final()[axis] == pytest.approx(in_time.final()[axis], abs=most_m)


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
    claims = [
        sum(line["budget"]["time"] for line in budgets(flown)) / len(budgets(flown)) for flown in (known, unknown)
    ]
    assert claims[1] > claims[0]
    assert miss_m(known) < 0.05
    assert miss_m(unknown) < 0.2


# 4xx: rates. (trouble, scenario, difference, the message attitudes come from, its rate, what the log says)

RATES = [
    (
        401,
        "a ground station takes them every 10 s",
        "gcs_thief",
        {"seconds": 26.0},
        "ATTITUDE_QUATERNION",
        100,
        NoticeCode.RATE_FELL,
    ),
    (402, "at most 0.8 of a loop of 50 Hz", "slow_loop", {}, "ATTITUDE_QUATERNION", 40, NoticeCode.RATE_REFUSED),
    (403, "only REQUEST_DATA_STREAM", "old_rates", {}, "ATTITUDE", 100, NoticeCode.INTERVALS_UNKNOWN),
    (404, "no quaternion", "no_quaternion", {}, "ATTITUDE", 100, NoticeCode.PITCH_TRIM_RESTORED),
    (405, "a reboot forgets them", "rebooting", {}, "ATTITUDE_QUATERNION", 100, NoticeCode.AUTOPILOT_REBOOTED),
    (406, "acknowledged and not sent", "px4_slow", {}, "ATTITUDE_QUATERNION", 18.4, NoticeCode.NOT_READY_SLOW_ATTITUDE),
]


@pytest.mark.parametrize(
    ("name", "differences", "message", "hz", "said"),
    [row[2:] for row in RATES],
    ids=[f"{number} {trouble}" for number, trouble, *_ in RATES],
)
def test_rates(name, differences, message, hz, said):
    flown = seen(name, **differences)
    status = flown.companion.pipeline.status(flown.mock.end_ns)
    assert status.telemetry.attitude_source == message
    assert status.telemetry.rates_hz[message] == pytest.approx(hz, rel=0.05)
    assert said in flown.companion.codes


def test_407_the_thief_is_named_where_check_looks():
    flown = seen("gcs_thief", seconds=26.0)
    undone_by = flown.companion.pipeline.status(flown.mock.end_ns).rates["ATTITUDE_QUATERNION"].undone_by
    assert "255/190" in undone_by
    lost = held_back(flown)
    assert lost["stale_attitude"] + lost["attitude_gap"] < 2 * 10 * 3.0, "three seconds for each of two thefts"
