"""Message contents against the truth of the same flight."""

from math import cos, isnan, radians, sin

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sitl_mock.earth import Place

ALL = {"ATTITUDE": 100.0, "ATTITUDE_QUATERNION": 100.0, "GLOBAL_POSITION_INT": 20.0, "LOCAL_POSITION_NED": 20.0}


def at_boot_ms(run, boot_ms):
    return run.flight.state_at(run.flight.clock.host_ns(boot_ms * 1_000_000))


def test_a_flapping_wing_on_ardupilot_or_px4(companion):
    assert companion(seconds=2.0).fly().of("HEARTBEAT")[0]["type"] == 16
    assert companion(seconds=2.0).fly().of("HEARTBEAT")[0]["autopilot"] == 3
    assert companion("px4", seconds=2.0).fly().of("HEARTBEAT")[0]["autopilot"] == 12


def test_attitude_comes_slowly_until_asked(companion):
    run = companion(seconds=4.0).ask_rate(2.0, "ATTITUDE", 50.0).fly()
    times = np.array(run.times_of("ATTITUDE")) * 1e-9 - 1000.0
    assert 7 <= np.sum(times < 2.0) <= 9
    assert 98 <= np.sum(times > 2.0) <= 101


def test_quaternion_and_euler_angles_are_one_attitude_and_rates_are_in_the_body(companion):
    changes = {"autopilot.attitude_on_whole_ms": True, "autopilot.gyro_filter_hz": 0.0, "autopilot.rates_hz": ALL}
    run = companion(**changes).fly()
    for fields in run.of("ATTITUDE_QUATERNION")[10:]:
        state = at_boot_ms(run, fields["time_boot_ms"])
        reported = Rotation.from_quat([fields[key] for key in ("q2", "q3", "q4", "q1")])
        assert (reported.inv() * Rotation.from_matrix(state.ned_from_body)).magnitude() < 1e-6
        np.testing.assert_allclose(
            [fields[key] for key in ("rollspeed", "pitchspeed", "yawspeed")], state.rates, atol=1e-5
        )
    for fields in run.of("ATTITUDE")[10:]:
        state = at_boot_ms(run, fields["time_boot_ms"])
        assert fields["pitch"] == pytest.approx(state.euler[1], abs=1e-6)
        assert fields["roll"] == pytest.approx(state.euler[0], abs=1e-6)


def test_the_trim_is_in_attitude_alone_and_flight_options_take_it_out(companion):
    changes = {"autopilot.attitude_on_whole_ms": True, "autopilot.rates_hz": ALL, "autopilot.pitch_trim_deg": 12.0}
    run = companion(**changes).fly()
    fields = run.of("ATTITUDE")[20]
    assert at_boot_ms(run, fields["time_boot_ms"]).euler[1] - fields["pitch"] == pytest.approx(radians(12.0), abs=1e-6)
    fields = run.of("ATTITUDE_QUATERNION")[20]
    reported = Rotation.from_quat([fields[key] for key in ("q2", "q3", "q4", "q1")]).as_euler("ZYX")
    assert reported[1] == pytest.approx(at_boot_ms(run, fields["time_boot_ms"]).euler[1], abs=1e-6)
    run = companion(**changes, **{"autopilot.flight_options": 1 << 8}).fly()
    fields = run.of("ATTITUDE")[20]
    assert fields["pitch"] == pytest.approx(at_boot_ms(run, fields["time_boot_ms"]).euler[1], abs=1e-6)


@pytest.mark.parametrize("loop_rate_hz", [50.0, 400.0])
def test_an_attitude_is_older_than_its_stamp_by_up_to_a_loop(companion, loop_rate_hz):
    """Measured on a slowly flapping pitch: the delay that explains it lies in [-1 ms, loop]; stamps are truncated."""
    changes = {
        "autopilot.loop_rate_hz": loop_rate_hz,
        "autopilot.rates_hz": {"ATTITUDE": 40.0},
        "seconds": 40.0,
        "camera.enabled": False,
        "autopilot.drift_ppm": 0.0,
        "flight.flapping_hz": 1.0,
    }
    run = companion(**changes).fly()
    delays = []
    for fields in run.of("ATTITUDE"):
        state = at_boot_ms(run, fields["time_boot_ms"])
        rate = state.rates[1] * cos(state.euler[0]) - state.rates[2] * sin(state.euler[0])
        if abs(rate) > 0.5:
            delays.append((state.euler[1] - fields["pitch"]) / rate)
    loop_s = 1.0 / loop_rate_hz
    assert len(delays) > 200
    assert min(delays) > -1.01e-3
    assert max(delays) < 1.05 * loop_s
    assert np.mean(delays) == pytest.approx(loop_s / 2 - 0.5e-3, abs=0.1 * loop_s)


def test_global_position_is_the_world_s_place_above_home(companion):
    run = companion(**{"autopilot.rates_hz": ALL}).fly()
    for fields in run.of("GLOBAL_POSITION_INT"):
        # The stamp is whole milliseconds; at 5 m/s with heave that is some millimetres.
        state = at_boot_ms(run, fields["time_boot_ms"] + 0.5)
        place = run.flight.world.place(state.position)
        assert fields["lat"] * 1e-7 == pytest.approx(place.lat, abs=2e-7)
        assert fields["lon"] * 1e-7 == pytest.approx(place.lon, abs=2e-7)
        assert fields["alt"] * 1e-3 == pytest.approx(place.alt_amsl, abs=0.005)
        assert fields["relative_alt"] * 1e-3 == pytest.approx(-state.position[2], abs=0.005)
        assert fields["vx"] * 0.01 == pytest.approx(state.velocity[0], abs=0.02)


def test_local_position_counts_from_the_ekf_origin_on_a_sphere(companion):
    run = companion(**{"autopilot.rates_hz": ALL, "autopilot.ekf_origin_m": (900.0, -400.0, -2.3)}).fly()
    fields = run.of("LOCAL_POSITION_NED")[5]
    state = at_boot_ms(run, fields["time_boot_ms"])
    relative = np.array(state.position) - (900.0, -400.0, -2.3)
    difference = np.array([fields[axis] for axis in "xyz"]) - relative
    assert 0.5 < abs(difference[0]) < 0.007 * 1000.0
    assert difference[2] == pytest.approx(0.0, abs=0.01)


def test_home_moves_at_arming_and_origin_is_not_home(companion):
    run = companion("home_moves", seconds=8.0).command(1.0, 512, 242).command(1.5, 512, 49).fly()
    before, after = run.of("HOME_POSITION")
    assert (after["altitude"] - before["altitude"]) * 1e-3 == pytest.approx(0.8, abs=0.01)
    assert after["altitude"] == 519_000
    (origin,) = run.of("GPS_GLOBAL_ORIGIN")
    assert origin["altitude"] == 521_300
    assert abs(origin["latitude"] - after["latitude"]) * 0.0111 > 3.0
    states = {heartbeat["base_mode"] & 128 for heartbeat in run.of("HEARTBEAT")}
    assert states == {0, 128}


def test_ellipsoid_height_is_above_sea_level_by_the_undulation(companion):
    fields = companion().fly().of("GPS_RAW_INT")[0]
    assert (fields["alt_ellipsoid"] - fields["alt"]) * 1e-3 == pytest.approx(47.0)
    assert fields["fix_type"] == 3


def test_without_gps_there_is_no_place_but_a_height(companion):
    run = companion("no_gps").fly()
    assert {(f["lat"], f["lon"]) for f in run.of("GLOBAL_POSITION_INT")} == {(0, 0)}
    assert run.of("GLOBAL_POSITION_INT")[0]["relative_alt"] > 8000
    assert not run.of("LOCAL_POSITION_NED")
    assert not run.of("HOME_POSITION")
    assert run.of("SYSTEM_TIME")[0]["time_unix_usec"] == 0


def test_a_late_fix_sets_origin_and_home(companion):
    run = companion("late_gps", seconds=4.0, **{"autopilot.gps_fix_at_s": 2.0}).fly()
    assert len(run.of("GPS_GLOBAL_ORIGIN")) == 1
    assert {f["lat"] == 0 for f in run.of("GLOBAL_POSITION_INT")} == {True, False}


def test_the_rangefinder_measures_along_the_body(companion):
    run = companion(**{"autopilot.rates_hz": {"DISTANCE_SENSOR": 20.0}}).fly()
    for fields in run.of("DISTANCE_SENSOR"):
        state = at_boot_ms(run, fields["time_boot_ms"])
        slant = -state.position[2] / state.ned_from_body[2][2]
        assert fields["current_distance"] * 0.01 == pytest.approx(slant, abs=0.2)
        assert fields["orientation"] == 25


def test_system_time_is_utc(companion):
    run = companion(**{"autopilot.utc_minus_host_wall_s": 123.0}).fly()
    now, heard = next((now, heard) for now, heard in run.heard if heard.name == "SYSTEM_TIME")
    utc_s = now * 1e-9 + run.flight.unix_minus_host_s + 123.0
    assert heard.fields["time_unix_usec"] * 1e-6 == pytest.approx(utc_s, abs=0.01)


def test_px4_sends_altitude_with_nothing_below(companion):
    fields = companion("px4").fly().of("ALTITUDE")[0]
    assert isnan(fields["altitude_terrain"])
    assert isnan(fields["bottom_clearance"])
    assert not companion("default").fly().of("ALTITUDE")


def test_heading_is_in_a_turn(companion):
    for fields in companion().fly().of("VFR_HUD"):
        assert 0 <= fields["heading"] < 360


def test_biases_reach_the_messages_with_their_signs(companion):
    biases = {"attitude_roll_deg": 1.0, "attitude_pitch_deg": -2.0, "heading_deg": 3.0, "height_m": 0.7}
    changes = {f"biases.{name}": value for name, value in biases.items()}
    run = companion(**changes, **{"autopilot.attitude_on_whole_ms": True, "autopilot.rates_hz": ALL}).fly()
    for fields in run.of("ATTITUDE")[10:30]:
        state = at_boot_ms(run, fields["time_boot_ms"])
        errors = np.degrees([fields[key] for key in ("roll", "pitch", "yaw")] - np.array(state.euler))
        np.testing.assert_allclose((errors + 180.0) % 360.0 - 180.0, [1.0, -2.0, 3.0], atol=1e-4)
    for fields in run.of("GLOBAL_POSITION_INT"):
        state = at_boot_ms(run, fields["time_boot_ms"] + 0.5)
        assert fields["relative_alt"] * 1e-3 + state.position[2] == pytest.approx(0.7, abs=0.005)


def test_noise_is_fresh_in_every_sample(companion):
    changes = {"priors.attitude_noise_deg": 0.3, "autopilot.attitude_on_whole_ms": True, "autopilot.rates_hz": ALL}
    run = companion(**changes, seconds=10.0).fly()
    errors = [np.degrees(f["pitch"] - at_boot_ms(run, f["time_boot_ms"]).euler[1]) for f in run.of("ATTITUDE")]
    assert np.std(errors) == pytest.approx(0.3, rel=0.1)
    assert abs(np.corrcoef(errors[:-1], errors[1:])[0, 1]) < 0.15


def horizontal_errors(run, late_s=0.0):
    errors = []
    for fields in run.of("GLOBAL_POSITION_INT"):
        state = at_boot_ms(run, fields["time_boot_ms"] + 0.5 - late_s * 1e3)
        place = Place(fields["lat"] * 1e-7, fields["lon"] * 1e-7, 519.0)
        errors.append(np.array(run.flight.world.ned(place)[:2]) - state.position[:2])
    return np.array(errors)


def test_the_position_wanders_slowly(companion):
    changes = {"biases.position_m": 2.0, "camera.enabled": False, "seconds": 200.0, "priors.position_bias_time_s": 20.0}
    run = companion(**changes).fly()
    errors = horizontal_errors(run)
    assert np.std(errors) == pytest.approx(2.0, rel=0.5)
    assert np.max(np.abs(np.diff(errors, axis=0))) < 1.5
    wander = run.flight.vehicle.belief.wander(run.flight.flight_s(run.times_of("GLOBAL_POSITION_INT")[50]))
    np.testing.assert_allclose(errors[50], wander, atol=0.05)


def test_a_position_is_as_old_as_told(companion):
    run = companion(**{"autopilot.position_delay_s": 0.15}).fly()
    assert np.abs(horizontal_errors(run, late_s=0.15)).max() < 0.03
    assert np.abs(horizontal_errors(run)).max() > 0.3
