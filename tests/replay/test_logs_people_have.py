"""Logs as flights leave them: receivers without a sampling time, simulators in 1970's seconds, slow ATT, odd clocks."""

import json
import math

import pytest
from autopilot_logs import DataFlash, ulog, usual
from draws import first_of
from logged_flights import Flown, bin_log, final_error_m, on_boot, on_unix, px4_log, quaternion, replayed

EPOCH_2026_US = 1_790_000_000_000_000


@pytest.fixture(scope="module")
def flown():
    return Flown()


def px4_topics(flown, *, epoch_us=0, gps_sample=None):
    """A PX4 log whose clock begins at ``epoch_us``; GPS rows carry ``gps_sample`` as timestamp_sample."""
    attitudes = [(epoch_us + t, *quaternion(state.euler)) for t, state in flown.states(100.0)]
    rates = [(epoch_us + t, *state.rates) for t, state in flown.states(100.0)]
    positions, velocities, home = [], [], []
    for t, state in flown.states(10.0):
        place = flown.place(state.position)
        positions.append((epoch_us + t, *(() if gps_sample is None else (0,)), place.lat, place.lon, place.alt_amsl))
        velocities.append((epoch_us + t, *state.velocity))
        home = [(epoch_us + t, place.alt_amsl + state.position[2])]
    sampled = [] if gps_sample is None else [("uint64_t", "timestamp_sample")]
    gps = [
        (epoch_us + t, *(() if gps_sample is None else (gps_sample,)), 3, EPOCH_2026_US + t)
        for t, _ in flown.states(2.0)
    ]
    return ulog(
        {
            "vehicle_attitude": ([("float[4]", "q")], attitudes),
            "vehicle_angular_velocity": ([("float[3]", "xyz")], rates),
            "vehicle_global_position": ([*sampled, ("double", "lat"), ("double", "lon"), ("float", "alt")], positions),
            "vehicle_local_position": ([("float", "vx"), ("float", "vy"), ("float", "vz")], velocities),
            "home_position": ([("float", "alt")], home),
            "sensor_gps": ([*sampled, ("uint8_t", "fix_type"), ("uint64_t", "time_utc_usec")], gps),
        }
    )


@pytest.mark.parametrize("stamp", first_of(on_unix, on_boot))
def test_a_receiver_that_leaves_its_sampling_time_zero(tmp_path, flown, stamp):
    (tmp_path / "flight.ulg").write_bytes(px4_topics(flown, gps_sample=0))
    _, lines = replayed(tmp_path, tmp_path / "flight.ulg", flown.detections(stamp))
    assert lines[-1]["fixes"] > 0.8 * lines[-1]["detections"]
    assert final_error_m(flown, lines) < 0.5


def on_epoch(boot_ns):
    return {"time_boot": EPOCH_2026_US / 1e6 + boot_ns / 1e9}


@pytest.mark.parametrize("stamp", first_of(on_epoch, on_unix))
def test_a_simulator_whose_boot_clock_counts_from_1970(tmp_path, flown, stamp):
    (tmp_path / "flight.ulg").write_bytes(px4_topics(flown, epoch_us=EPOCH_2026_US))
    done, lines = replayed(tmp_path, tmp_path / "flight.ulg", flown.detections(stamp))
    assert lines[-1]["fixes"] > 0.8 * lines[-1]["detections"]
    assert final_error_m(flown, lines) < 0.5
    assert "no UTC" not in done.stderr
    times = [line["time_unix"] for line in lines if line["type"] == "target"]
    assert all(EPOCH_2026_US / 1e6 < time < EPOCH_2026_US / 1e6 + 100 for time in times)


def slow_att_log(flown, trim):
    """ATT at 2 Hz; the filter's quaternion at 50 Hz, without the trim."""
    log = usual(DataFlash())
    log.describe("XKQ", 79, "QBffff", "TimeUS,C,Q1,Q2,Q3,Q4")
    for boot_us, state in flown.states(2.0):
        roll, pitch, yaw = (math.degrees(angle) for angle in state.euler)
        log.put("ATT", boot_us, 0, roll, 0, pitch, 0, yaw % 360, 0, 0)
    for boot_us, state in flown.states(50.0):
        roll, pitch, yaw = state.euler
        log.put("XKQ", boot_us, 0, *quaternion((roll, pitch - trim, yaw)))
        log.put("IMU", boot_us, 0, *state.rates, 0, 0, 0)
    for boot_us, state in flown.states(10.0):
        place = flown.place(state.position)
        log.put("XKF1", boot_us, 0, 0, 0, 0, *state.velocity, 0, 0, 0, 0, 0)
        log.put("POS", boot_us, place.lat, place.lon, place.alt_amsl, -state.position[2], 0)
    return bytes(log.data)


@pytest.mark.parametrize("trim_deg", first_of(3.0, 0.0))
def test_the_filters_quaternion_replaces_a_slow_att_with_its_trim(tmp_path, flown, trim_deg):
    (tmp_path / "flight.bin").write_bytes(slow_att_log(flown, math.radians(trim_deg)))
    done, lines = replayed(tmp_path, tmp_path / "flight.bin", flown.detections(on_boot))
    assert "ATT comes" not in done.stderr
    assert final_error_m(flown, lines) < 0.3


@pytest.mark.parametrize(("rate", "said"), [(4.6, "4.6 times as fast as GPS"), (0.9, "10.0 % slow against GPS")])
def test_a_log_whose_clock_runs_at_another_rate_is_reported(tmp_path, flown, rate, said):
    log = usual(DataFlash())
    for boot_us, state in flown.states(20.0):
        roll, pitch, yaw = (math.degrees(angle) for angle in state.euler)
        log.put("ATT", round(boot_us * rate), 0, roll, 0, pitch, 0, yaw % 360, 0, 0)
    for boot_us, state in flown.states(5.0):
        place = flown.place(state.position)
        log.put("POS", round(boot_us * rate), place.lat, place.lon, place.alt_amsl, -state.position[2], 0)
        week, rest = divmod(1_790_000_000.0 + boot_us / 1e6 + 18 - 315_964_800, 604_800)
        log.put("GPS", round(boot_us * rate), 0, 3, round(rest * 1000), int(week), 12, 0.8, place.lat, place.lon, 0.0)
    (tmp_path / "flight.bin").write_bytes(bytes(log.data))
    done, _ = replayed(tmp_path, tmp_path / "flight.bin", flown.detections(on_boot))
    assert said in done.stderr


def test_a_clock_that_keeps_its_pace_is_not_reported(tmp_path, flown):
    for name, make in (("flight.bin", bin_log), ("flight.ulg", px4_log)):
        (tmp_path / name).write_bytes(make(flown))
        done, _ = replayed(tmp_path, tmp_path / name, flown.detections(on_boot))
        assert "against GPS" not in done.stderr


def test_a_bad_first_line_does_not_step_through_the_years(tmp_path, flown):
    """The detections' first line has no place in time: it is refused by name, at the beginning of the flight."""
    (tmp_path / "flight.bin").write_bytes(bin_log(flown))
    bad = json.dumps({"time_monotonic": 5000.0, "detections": []}) + "\n" + "{broken\n"
    _, lines = replayed(tmp_path, tmp_path / "flight.bin", bad + flown.detections(on_unix))
    dropped = lines[-1]["dropped_frames"]
    assert (dropped["no_monotonic_map"], dropped["malformed"]) == (1, 1)
    assert len(lines) < 2000
    _, lines = replayed(tmp_path, tmp_path / "flight.bin", json.dumps({"time_monotonic": 5.0, "detections": []}) + "\n")
    assert lines[-1]["dropped_frames"] == {"no_monotonic_map": 1}
    assert len(lines) < 200
