"""The telemetry package as a whole: its inputs and its answers."""

from math import radians

import pytest
from telemetry_messages import MS, Autopilot, climbing, pitch_deg

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.telemetry import AttitudeSource, PitchTrimUndone, Rebooted
from fwav_companion.types import ClockExchange, Reason, Unpaired


@pytest.mark.parametrize(
    ("vehicle_type", "parameters", "missing_deg"),
    [
        (16, {"PTCH_TRIM_DEG": 5.0, "FLIGHT_OPTIONS": 0.0}, 5.0),
        (1, {"TRIM_PITCH_CD": -300.0}, -3.0),
        (16, {"PTCH_TRIM_DEG": 5.0, "FLIGHT_OPTIONS": 256.0}, 0.0),
        (21, {"PTCH_TRIM_DEG": 5.0}, 0.0),
        (16, {"PTCH_TRIM_DEG": float("nan"), "FLIGHT_OPTIONS": float("inf")}, 0.0),
        (16, {}, 0.0),
    ],
    ids=["flapping wing", "older name", "stays on by option", "quadplane", "nonsense", "copter"],
)
def test_the_pitch_trim_that_attitude_lacks_is_put_back(vehicle_type, parameters, missing_deg):
    """Once it is known, samples taken without it are forgotten, and no interpolation crosses the step."""
    autopilot = Autopilot()
    autopilot.send("HEARTBEAT", 0, type=vehicle_type)
    autopilot.attitudes(0, 200)
    for name, value in parameters.items():
        autopilot.send("PARAM_VALUE", 200, param_id=name, param_value=value)
    autopilot.attitudes(200, 400)
    assert pitch_deg(autopilot, 303.0) == pytest.approx(missing_deg, abs=1e-9)
    reported = [event.deg for event in autopilot.events if isinstance(event, PitchTrimUndone)]
    assert reported == ([missing_deg] if missing_deg else [])
    assert autopilot.telemetry.status(autopilot.host(400.0)).pitch_trim_undone_deg == missing_deg
    if missing_deg:
        assert autopilot.telemetry.state_at(BootNs(195 * MS)) == Unpaired(Reason.BEFORE_HISTORY, pytest.approx(5e-3))


def test_a_quaternion_knows_no_trim():
    autopilot = Autopilot()
    autopilot.send("PARAM_VALUE", 0, param_id="PTCH_TRIM_DEG", param_value=5.0)
    autopilot.attitudes(0, 200, name="ATTITUDE_QUATERNION")
    assert pitch_deg(autopilot, 103.0) == 0.0
    assert autopilot.telemetry.status(autopilot.host(200.0)).pitch_trim_undone_deg is None


def test_quaternions_are_preferred_and_the_change_leaves_no_step():
    """ATTITUDE carries a trim of 37 degrees; no interpolation may mix it with quaternions."""
    autopilot = Autopilot()
    for boot_ms in range(0, 500, 10):
        autopilot.send("ATTITUDE", boot_ms, pitch=radians(-37.0))
    for boot_ms in range(500, 1000, 10):
        autopilot.send("ATTITUDE", boot_ms, pitch=radians(-37.0))
        autopilot.send("ATTITUDE_QUATERNION", boot_ms + 5)
    assert [e for e in autopilot.events if isinstance(e, AttitudeSource)] == [
        AttitudeSource("ATTITUDE_QUATERNION", "ATTITUDE")
    ]
    assert autopilot.telemetry.state_at(BootNs(490 * MS)).reason is Reason.BEFORE_HISTORY
    for boot_ms in range(505, 990, 7):
        assert pitch_deg(autopilot, boot_ms) == pytest.approx(0.0, abs=1e-9)


def test_attitude_does_not_come_back_until_quaternions_are_silent_for_long():
    autopilot = Autopilot()
    autopilot.attitudes(0, 1000, name="ATTITUDE_QUATERNION")
    autopilot.attitudes(1000, 10_900)
    assert isinstance(autopilot.telemetry.state_at(BootNs(10_800 * MS)), Unpaired)
    autopilot.attitudes(10_900, 12_000)
    assert autopilot.events[-1] == AttitudeSource("ATTITUDE", "ATTITUDE_QUATERNION")
    assert not isinstance(autopilot.telemetry.state_at(BootNs(11_900 * MS)), Unpaired)


@pytest.mark.parametrize("wanted", ["ATTITUDE", "ATTITUDE_QUATERNION"])
def test_a_configured_message_is_the_only_one(wanted):
    autopilot = Autopilot(attitude_message=wanted)
    other = {"ATTITUDE": "ATTITUDE_QUATERNION", "ATTITUDE_QUATERNION": "ATTITUDE"}[wanted]
    autopilot.attitudes(0, 500, name=other)
    assert autopilot.telemetry.state_at(BootNs(300 * MS)) == Unpaired(Reason.NO_ATTITUDE)
    autopilot.attitudes(500, 600, name=wanted)
    assert not isinstance(autopilot.telemetry.state_at(BootNs(550 * MS)), Unpaired)


def test_a_reboot_is_reported_once_and_everything_of_the_old_clock_is_gone():
    autopilot = Autopilot()
    autopilot.attitudes(60_000, 62_000)
    autopilot.send("GLOBAL_POSITION_INT", 61_000)
    origin = autopilot.telemetry.world.plane.origin
    autopilot.host_at_boot += 65_000 * MS
    autopilot.attitudes(2000, 2020)
    assert not any(isinstance(event, Rebooted) for event in autopilot.events)
    autopilot.attitudes(2020, 3000)
    assert sum(isinstance(event, Rebooted) for event in autopilot.events) == 1
    assert isinstance(autopilot.telemetry.state_at(BootNs(61_500 * MS)), Unpaired)
    state = autopilot.telemetry.state_at(BootNs(2500 * MS))
    assert state.position_ned is None
    assert autopilot.telemetry.world.plane.origin == origin
    host_ns = autopilot.telemetry.clock.host_from_boot(BootNs(2500 * MS))
    assert abs(host_ns - autopilot.host(2500)) < 2 * MS


def test_a_reboot_in_silence():
    """Up for 5 s, silent for 20, back with a stamp of 6 s: it has run for less than it was silent."""
    autopilot = Autopilot()
    exchanged = []

    def exchange(boot_ms: int) -> None:
        at = autopilot.host(boot_ms)
        exchanged.append(autopilot.telemetry.on_exchange(ClockExchange(at, at + 4 * MS, BootNs((boot_ms + 2) * MS))))

    for boot_ms in range(1000, 5000, 100):
        autopilot.send("ATTITUDE", boot_ms)
        exchange(boot_ms)
    autopilot.host_at_boot += 19_000 * MS
    for boot_ms in range(6000, 7000, 100):
        autopilot.send("ATTITUDE", boot_ms)
        exchange(boot_ms)
    reported = [*autopilot.events, *(event for events in exchanged for event in events)]
    assert sum(isinstance(event, Rebooted) for event in reported) == 1
    assert abs(autopilot.telemetry.clock.host_from_boot(BootNs(6900 * MS)) - autopilot.host(6900)) < MS


def test_past_the_wrap_everything_goes_on():
    """Stamps wrap at 49.7 days; TIMESYNC's nanoseconds do not."""
    wrap_ms = 2**32
    autopilot = Autopilot()
    for boot_ms in range(wrap_ms - 2000, wrap_ms + 2000, 10):
        autopilot.send("ATTITUDE", boot_ms, pitch=radians((boot_ms - wrap_ms) / 100.0))
        if boot_ms % 100 == 96:
            at = autopilot.host(boot_ms)
            autopilot.telemetry.on_exchange(ClockExchange(at, at + 4 * MS, BootNs((boot_ms + 2) * MS)))
    assert autopilot.events == []
    for boot_ms in (wrap_ms - 503, wrap_ms - 5, wrap_ms + 1, wrap_ms + 803):
        assert pitch_deg(autopilot, boot_ms) == pytest.approx((boot_ms - wrap_ms) / 100.0, abs=1e-6)
        assert abs(autopilot.telemetry.clock.host_from_boot(BootNs(boot_ms * MS)) - autopilot.host(boot_ms)) < MS // 10


def test_a_session_that_begins_after_the_wrap():
    wrap_ms = 2**32
    autopilot = Autopilot()
    for boot_ms in range(wrap_ms + 5000, wrap_ms + 7000, 10):
        autopilot.send("ATTITUDE", boot_ms)
        if boot_ms % 100 == 50:
            at = autopilot.host(boot_ms)
            autopilot.telemetry.on_exchange(ClockExchange(at, at + 4 * MS, BootNs((boot_ms + 2) * MS)))
    assert autopilot.events == []
    boot_ns = autopilot.telemetry.clock.boot_from_host(autopilot.host(wrap_ms + 6505))
    assert not isinstance(autopilot.telemetry.state_at(boot_ns), Unpaired)


def test_positions_between_and_beyond():
    """A path of constant acceleration is followed exactly between samples, and by its velocity beyond."""
    autopilot = Autopilot()
    for boot_ms in range(0, 1100, 100):
        autopilot.attitudes(boot_ms, boot_ms + 100)
        t = boot_ms * 1e-3
        autopilot.send("GLOBAL_POSITION_INT", boot_ms, relative_alt=round(10_000 + 1000 * t * t), vz=round(-200 * t))
    autopilot.attitudes(1100, 1300)
    for boot_ms in (150, 420, 777):
        t = (boot_ms - 0.5) * 1e-3  # a cut stamp is 0.5 ms early
        height_m = autopilot.telemetry.state_at(BootNs(boot_ms * MS)).height_above_home_m
        assert height_m == pytest.approx(10.0 + t * t, abs=1.5e-3)
    inside, beyond = (autopilot.telemetry.state_at(BootNs(ms * MS)) for ms in (950, 1200))
    assert beyond.position_sigma_m > 10.0 * inside.position_sigma_m
    assert beyond.height_above_home_m == pytest.approx(11.0 + 2.0 * 0.1995, abs=2e-3)


def test_an_old_position_is_none():
    autopilot = Autopilot()
    autopilot.send("GLOBAL_POSITION_INT", 0)
    autopilot.attitudes(0, 3000)
    assert autopilot.telemetry.state_at(BootNs(1900 * MS)).position_ned is not None
    assert autopilot.telemetry.state_at(BootNs(2100 * MS)).position_ned is None


def test_a_position_is_as_old_as_configured():
    autopilot = Autopilot(position_delay_s=0.1)
    autopilot.attitudes(0, 1000)
    for boot_ms in range(0, 1000, 100):
        autopilot.send("GLOBAL_POSITION_INT", boot_ms, relative_alt=boot_ms, vz=-100)
    state = autopilot.telemetry.state_at(BootNs(500 * MS + 500_000))
    assert state.height_above_home_m == pytest.approx(0.6, abs=1e-6)


def test_heights_by_preference():
    autopilot = Autopilot()
    autopilot.attitudes(0, 1000)
    autopilot.send("ALTITUDE", 500, altitude_relative=7.0)
    assert autopilot.telemetry.state_at(BootNs(510 * MS)).height_above_home_m == pytest.approx(7.0)
    autopilot.send("GLOBAL_POSITION_INT", 510, lat=0, lon=0, relative_alt=9000)
    assert autopilot.telemetry.state_at(BootNs(520 * MS)).height_above_home_m == pytest.approx(9.0)


def test_vfr_hud_needs_a_home():
    autopilot = Autopilot(position="none")
    autopilot.attitudes(0, 1000)
    autopilot.send("VFR_HUD", 500, alt=497.0)
    assert autopilot.telemetry.state_at(BootNs(510 * MS)).height_above_home_m is None
    autopilot.send("HOME_POSITION", 520)
    autopilot.send("VFR_HUD", 530, alt=497.0)
    assert autopilot.telemetry.state_at(BootNs(540 * MS)).height_above_home_m == pytest.approx(7.0)


def test_other_sources():
    autopilot = Autopilot()
    autopilot.attitudes(0, 1000)
    autopilot.send("DISTANCE_SENSOR", 500, current_distance=812)
    autopilot.send("TERRAIN_REPORT", 500)
    autopilot.send("LOCAL_POSITION_NED", 500, x=3.0, vx=10.0)
    autopilot.send("GPS_RAW_INT", 500)
    state = autopilot.telemetry.state_at(BootNs(510 * MS))
    assert state.range.distance_m == pytest.approx(8.12)
    assert state.terrain_height_m == 20.0
    assert autopilot.telemetry.state_at(BootNs(800 * MS)).range is None
    assert autopilot.telemetry.local_position_at(BootNs(520 * MS + 500_000)) == pytest.approx((3.2, 0.0, 0.0))
    assert autopilot.telemetry.undulation_m == 47.0
    autopilot.send("TERRAIN_REPORT", 600, spacing=0)
    assert autopilot.telemetry.status(autopilot.host(600)).refused == {"TERRAIN_REPORT": 1}


def test_utc_by_system_time():
    autopilot = Autopilot()
    autopilot.attitudes(0, 200)
    assert autopilot.telemetry.utc_minus_host_s is None
    autopilot.send("SYSTEM_TIME", 200, time_unix_usec=0)
    assert autopilot.telemetry.utc_minus_host_s is None
    autopilot.send("SYSTEM_TIME", 300, time_unix_usec=1_790_000_000_000_000)
    expected = 1_790_000_000 - autopilot.host(300.5) * 1e-9
    assert autopilot.telemetry.utc_minus_host_s == pytest.approx(expected, abs=1e-3)


def test_system_time_that_jumps_is_counted_and_moves_utc_only_when_the_next_one_agrees():
    autopilot = Autopilot()
    autopilot.attitudes(0, 200)
    start, jumped = 1_790_000_000_000_000, 1_790_000_900_000_000
    autopilot.send("SYSTEM_TIME", 1000, time_unix_usec=start)
    before, line = autopilot.telemetry.utc_minus_host_s, autopilot.telemetry.clock.host_from_boot(BootNs(1000 * MS))
    for boot_ms, unix_usec in ((2000, jumped), (3000, 5), (4000, start + 3_000_000)):
        autopilot.send("SYSTEM_TIME", boot_ms, time_unix_usec=unix_usec)
        assert autopilot.telemetry.utc_minus_host_s == pytest.approx(before, abs=1e-3)
    assert autopilot.telemetry.clock.host_from_boot(BootNs(1000 * MS)) == line
    assert autopilot.telemetry.status(autopilot.host(4000)).refused == {"SYSTEM_TIME": 1}
    autopilot.send("SYSTEM_TIME", 5000, time_unix_usec=jumped)
    autopilot.send("SYSTEM_TIME", 6000, time_unix_usec=jumped + 1_000_000)
    assert autopilot.telemetry.utc_minus_host_s - before == pytest.approx(896.0, abs=1e-3)
    assert autopilot.telemetry.status(autopilot.host(6000)).refused == {"SYSTEM_TIME": 2}


def test_status_shows_rates_and_interpolation():
    autopilot = Autopilot()
    climbing(autopilot, 6000)
    status = autopilot.telemetry.status(autopilot.host(6000))
    assert status.rates_hz["ATTITUDE"] == pytest.approx(100.0, abs=1.0)
    assert status.attitude_source == "ATTITUDE"
    assert status.interpolation == "four attitudes"
    assert status.attitudes_kept <= 301


def test_without_interpolation_ten_attitudes_a_second_are_taken_and_all_are_counted():
    autopilot = Autopilot(attitudes_kept_s=0.0)
    taken: set[int] = set()
    for boot_ms in range(0, 2000, 10):
        autopilot.send("ATTITUDE", boot_ms)
        taken |= {sample.boot_ns for sample in autopilot.telemetry.attitudes}
    assert taken == {BootNs(boot_ms * MS) for boot_ms in range(0, 2000, 100)}
    status = autopilot.telemetry.status(autopilot.host(2000))
    assert status.rates_hz["ATTITUDE"] == pytest.approx(100.0, abs=1.0)
    assert (status.attitude_source, status.attitudes_kept) == ("ATTITUDE", 1)


def test_another_epoch_of_the_host_gives_the_same_states():
    states = []
    for host_at_boot in (0, 1_790_000_000_123_456_000):
        autopilot = Autopilot(host_at_boot=host_at_boot, delay_ms=3.0)
        climbing(autopilot, 1000, every_ms=8)
        autopilot.send("GLOBAL_POSITION_INT", 1000)
        boot_ns = autopilot.telemetry.clock.boot_from_host(autopilot.host(903.3))
        states.append((boot_ns, autopilot.telemetry.state_at(boot_ns)))
    assert states[0] == states[1]
