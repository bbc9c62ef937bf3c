"""A mock flight as autopilots' own logs have it, and the replay of such a log."""

import json
import math

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
        self._states = {}
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
        """(boot time in us, true state) at this rate; every log of the flight has the same ones."""
        if hz not in self._states:
            hosts_ns = [self.start_ns + round(count / hz * 1e9) for count in range(round(SECONDS * hz))]
            boot_us = [self.mock.clock.boot_ns(host_ns) // 1000 for host_ns in hosts_ns]
            self._states[hz] = list(zip(boot_us, map(self.mock.state_at, hosts_ns), strict=True))
        return self._states[hz]

    def place(self, position):
        return self.mock.world.place(position)


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
