"""A mock flight as the autopilot's own log would have it, .bin and .ulg, replayed with detections made afterwards."""

import json
import math

import pytest
from autopilot_logs import DataFlash, ulog, usual
from commands import run_command
from flying import CAMERA, LINK

from sitl_mock import scenario, simulate

CONFIG = LINK + '[camera]\ncalibration = "camera.yaml"\n'
SECONDS = 25.0
GPS_MINUS_UTC_S, WEEK_S, EPOCH_S = 18, 604_800, 315_964_800


class Flown:
    """A flight's states at 100 Hz on the autopilot's clock."""

    def __init__(self):
        options = scenario("unbiased").but({"seconds": SECONDS, "seed": 5, "camera.clutter": 0.0})
        self.mock = simulate(options)
        self.frames = []
        while (at := self.mock.wake_at) is not None:
            for _, what in self.mock.advance(at):
                if isinstance(what, dict):
                    self.frames.append(what)
        self.start_ns = self.mock.start_host_ns

    def detections(self, stamp):
        """Lines as a detector would write them after the flight."""
        lines = []
        for frame in self.frames:
            host_ns = round(frame["time_monotonic"] * 1e9)
            kept = {key: value for key, value in frame.items() if key != "time_monotonic"}
            lines.append(json.dumps(stamp(self.mock.clock.boot_ns(host_ns)) | kept))
        return "\n".join(lines) + "\n"

    def states(self, hz):
        for count in range(round(SECONDS * hz)):
            host_ns = self.start_ns + round(count / hz * 1e9)
            boot_us = self.mock.clock.boot_ns(host_ns) // 1000
            yield boot_us, self.mock.state_at(host_ns)

    def place(self, position):
        return self.mock.world.place(position)


@pytest.fixture(scope="module")
def flown():
    return Flown()


def bin_log(flown, att_hz=100.0):
    log = usual(DataFlash())
    unix_s = 1_790_000_000.0
    for boot_us, state in flown.states(att_hz):
        roll, pitch, yaw = (math.degrees(angle) for angle in state.euler)
        log.put("IMU", boot_us, 0, *state.rates, 0, 0, 0)
        log.put("ATT", boot_us, 0, roll, 0, pitch, 0, yaw % 360, 0, 0)
    for boot_us, state in flown.states(10.0):
        place = flown.place(state.position)
        log.put("XKF1", boot_us, 0, 0, 0, 0, *state.velocity, 0, 0, 0, 0, 0)
        log.put("POS", boot_us, place.lat, place.lon, place.alt_amsl, -state.position[2], 0)
        gps_s = unix_s + boot_us / 1e6 + GPS_MINUS_UTC_S - EPOCH_S
        week, rest = divmod(gps_s, WEEK_S)
        log.put("GPS", boot_us, 0, 3, round(rest * 1000), int(week), 12, 0.8, place.lat, place.lon, place.alt_amsl)
    return bytes(log.data)


def quaternion(euler):
    cr, cp, cy = (math.cos(angle / 2) for angle in euler)
    sr, sp, sy = (math.sin(angle / 2) for angle in euler)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def px4_log(flown):
    attitudes = [(t, *quaternion(state.euler)) for t, state in flown.states(100.0)]
    rates = [(t, *state.rates) for t, state in flown.states(100.0)]
    positions, velocities, home = [], [], []
    for t, state in flown.states(10.0):
        place = flown.place(state.position)
        positions.append((t, place.lat, place.lon, place.alt_amsl))
        velocities.append((t, *state.velocity))
        home = [(t, place.alt_amsl + state.position[2])]
    return ulog(
        {
            "vehicle_attitude": ([("float[4]", "q")], attitudes),
            "vehicle_angular_velocity": ([("float[3]", "xyz")], rates),
            "vehicle_global_position": ([("double", "lat"), ("double", "lon"), ("float", "alt")], positions),
            "vehicle_local_position": ([("float", "vx"), ("float", "vy"), ("float", "vz")], velocities),
            "home_position": ([("float", "alt")], home),
            "sensor_gps": ([("uint8_t", "fix_type"), ("uint64_t", "time_utc_usec")],
                           [(t, 3, 1_790_000_000_000_000 + t) for t, _ in flown.states(2.0)]),
        }
    )  # fmt: skip


def replayed(folder, telemetry, detections, *more):
    (folder / "flight.toml").write_text(CONFIG)
    (folder / "camera.yaml").write_text(CAMERA)
    (folder / "detections.jsonl").write_text(detections)
    words = [
        *("replay", "--telemetry", str(telemetry), "--json", "--detections", "detections.jsonl"),
        *("--config", "flight.toml", "--out", "targets.jsonl", *more),
    ]
    done = run_command(*words, folder=folder)
    assert done.returncode == 0, done.stderr
    lines = [json.loads(line) for line in (folder / "targets.jsonl").read_text().splitlines()]
    return done, lines


def final_error_m(flown, lines):
    confirmed = [line for line in lines if line["type"] == "target" and line["state"] in ("confirmed", "coasting")]
    true = flown.mock.scene[0].at(SECONDS)
    plane = lines[0]["origin"]
    north = (flown.place(true).lat - plane["lat"]) * 111_200.0
    return abs(confirmed[-1]["north"] - north)


def on_boot(boot_ns):
    return {"time_boot": boot_ns / 1e9}


def on_unix(boot_ns):
    return {"time_unix": 1_790_000_000.0 + boot_ns / 1e9}


@pytest.mark.parametrize("stamp", [on_boot, on_unix])
@pytest.mark.parametrize(("name", "make"), [("flight.bin", bin_log), ("flight.ulg", px4_log)])
def test_a_flight_that_people_already_have(tmp_path, flown, name, make, stamp):
    (tmp_path / name).write_bytes(make(flown))
    done, lines = replayed(tmp_path, tmp_path / name, flown.detections(stamp))
    summary = lines[-1]
    assert summary["fixes"] > 0.8 * summary["detections"]
    assert final_error_m(flown, lines) < 0.5
    assert "too slow" not in done.stderr


def test_a_log_whose_attitudes_are_too_slow_says_so(tmp_path, flown):
    (tmp_path / "flight.bin").write_bytes(bin_log(flown, att_hz=10.0))
    done, _ = replayed(tmp_path, tmp_path / "flight.bin", flown.detections(on_boot))
    assert "ATT comes at 10 Hz, which is too slow for this motion" in done.stderr


def test_damage_in_a_log_is_reported_with_its_offset(tmp_path, flown):
    data = bin_log(flown)
    at = data.index(b"\xa3\x95\x46", len(data) // 3)
    (tmp_path / "flight.bin").write_bytes(data[:at] + b"\0" * 7 + data[at:])
    done, _ = replayed(tmp_path, tmp_path / "flight.bin", flown.detections(on_boot))
    doubtful = data.rindex(b"\xa3\x95", 0, at)  # the record before may be half damage
    assert f"skipped {at + 7 - doubtful} damaged bytes at offset {doubtful}" in done.stderr


def of_2014():
    log = usual(DataFlash())
    log.describe("ATT", 70, "IccccCC", "TimeMS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw")
    log.put("ATT", 95891, 0.0, -0.25, 0.0, 0.26, 189.54, 189.54)
    return bytes(log.data)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("empty.bin", bytes(usual(DataFlash()).data), "it has no readable attitude"),
        ("empty.ulg", ulog({}), "it has no readable attitude"),
        ("2014.bin", of_2014(), "as ArduPilot writes it since 2015"),
        ("text.log", b"ArduCopter V3.1\n\nFMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format\n", "as text"),
    ],
)
def test_a_log_without_a_flight_is_one_line_and_exit_2(tmp_path, name, content, said):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(AssertionError, match=rf"{name}: .*{said}"):
        replayed(tmp_path, tmp_path / name, "")
