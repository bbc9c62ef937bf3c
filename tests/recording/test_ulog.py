"""PX4's logs of different versions: values that a version does not log are not invented."""

import pytest
from autopilot_logs import ulog

from fwav_companion.recording.log_messages import messages_of
from fwav_companion.recording.ulog import read_ulog

ATTITUDE = ([("float[4]", "q")], [(1_000_000 + 10_000 * step, 1.0, 0.0, 0.0, 0.0) for step in range(200)])
PLACES = (
    [("double", "lat"), ("double", "lon"), ("float", "alt")],
    [(1_000_000 + 100_000 * step, 48.1 + 9e-6 * step, 11.5, 531.0) for step in range(20)],
)
VELOCITIES = (
    [("float", "vx"), ("float", "vy"), ("float", "vz")],
    [(1_000_000 + 100_000 * step, 1.0, -2.0, 0.5) for step in range(20)],
)


def read(tmp_path, **topics):
    (tmp_path / "flight.ulg").write_bytes(ulog({"vehicle_attitude": ATTITUDE, **topics}))
    return read_ulog(tmp_path / "flight.ulg")


def reported(log, name):
    return [fields for _, each, fields in messages_of(log) if each == name]


def test_velocities_are_the_estimators_where_it_reports_them(tmp_path):
    log, skipped, damaged = read(tmp_path, vehicle_global_position=PLACES, vehicle_local_position=VELOCITIES)
    assert (skipped, damaged) == ([], False)
    assert {(each["vx"], each["vy"], each["vz"]) for each in reported(log, "GLOBAL_POSITION_INT")} == {(100, -200, 50)}


def test_velocities_come_from_positions_where_they_are_not_logged(tmp_path):
    log, _, _ = read(tmp_path, vehicle_global_position=PLACES)
    assert [each["vx"] for each in reported(log, "GLOBAL_POSITION_INT")] == [pytest.approx(1000, abs=2)] * 20


@pytest.mark.parametrize("topic", ["vehicle_gps_position", "sensor_gps"])
def test_utc_comes_by_either_name_of_the_receiver(tmp_path, topic):
    rows = [(1_000_000 + 200_000 * step, 3, 1_790_000_000_000_000 + 200_000 * step) for step in range(10)]
    log, _, _ = read(tmp_path, **{topic: ([("uint8_t", "fix_type"), ("uint64_t", "time_utc_usec")], rows)})
    assert log.unix_minus_boot_us == 1_790_000_000_000_000 - 1_000_000


def test_one_receiver_message_of_another_day_does_not_place_the_flight(tmp_path):
    rows = [(1_000_000 + 200_000 * step, 3, 1_790_000_000_000_000 + 200_000 * step) for step in range(10)]
    rows[4] = (rows[4][0], 3, rows[4][2] + (1 << 40))
    log, _, _ = read(tmp_path, sensor_gps=([("uint8_t", "fix_type"), ("uint64_t", "time_utc_usec")], rows))
    assert log.unix_minus_boot_us == 1_790_000_000_000_000 - 1_000_000


def test_without_a_home_the_flight_begins_on_the_ground(tmp_path):
    log, _, _ = read(tmp_path, vehicle_global_position=PLACES)
    assert log.positions[0].height_above_home_m == 0.0
    home = ([("float", "alt")], [(1_000_000, 500.0)])
    log, _, _ = read(tmp_path, vehicle_global_position=PLACES, home_position=home)
    assert log.positions[0].height_above_home_m == pytest.approx(31.0)


@pytest.mark.parametrize("damaged", [float("nan"), float("inf")])
def test_rows_whose_time_is_no_number_are_left_out(tmp_path, damaged):
    """A damaged definition calls the sampling time a float: a traceback."""
    rows = [(row[0], damaged if step % 10 == 5 else float(row[0]), *row[1:]) for step, row in enumerate(ATTITUDE[1])]
    log, _, _ = read(tmp_path, vehicle_attitude=([("double", "timestamp_sample"), *ATTITUDE[0]], rows))
    assert len(log.attitudes) == len(rows) * 9 // 10
