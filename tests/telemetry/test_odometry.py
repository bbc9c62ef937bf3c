"""ODOMETRY as the autopilot's local position: its frames, what is refused, its stamps and its reset counter."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from telemetry_messages import MS, Autopilot

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.telemetry import LocalWorld, PositionJumped, RelativeWorld

FLOW = 1 | 2 | 4 | 8 | 32 | 256
"""ESTIMATOR_STATUS of a vehicle with optical flow: no absolute position."""
NED_VELOCITY = (1.7, 0.4, -0.2)
TURNED = Rotation.from_euler("ZYX", (120.0, 15.0, -8.0), degrees=True)
"""Body to NED."""
BODY = {
    "child_frame_id": 12,
    "q": tuple(np.roll(TURNED.as_quat(), 1)),
    **dict(zip(("vx", "vy", "vz"), TURNED.inv().apply(NED_VELOCITY), strict=True)),
}
NED = {"child_frame_id": 1, **dict(zip(("vx", "vy", "vz"), NED_VELOCITY, strict=True))}


def kinds(autopilot, kind):
    return [event for event in autopilot.events if isinstance(event, kind)]


def fly(autopilot, from_ms, until_ms, *, start_ms=0, every_ms=100, local=False, **odometry):
    """Straight on with NED_VELOCITY from (0, -2, -2.5)."""
    for boot_ms in range(from_ms, until_ms, every_ms):
        if boot_ms % 1000 == 0:
            autopilot.send("HEARTBEAT", boot_ms, autopilot=12, base_mode=128)
            autopilot.send("ESTIMATOR_STATUS", boot_ms, flags=FLOW)
        autopilot.send("ATTITUDE", boot_ms)
        if local:
            autopilot.send("LOCAL_POSITION_NED", boot_ms, x=100.0)
        place = np.array((0.0, -2.0, -2.5)) + np.array(NED_VELOCITY) * (boot_ms - start_ms) * 1e-3
        autopilot.send("ODOMETRY", boot_ms, **{**dict(zip("xyz", place, strict=True)), **odometry})


@pytest.mark.parametrize("frame", [NED, BODY], ids=["velocity_ned", "velocity_body"])
def test_odometry_alone_is_the_local_world_and_moves_with_its_velocity_in_ned(frame):
    autopilot = Autopilot()
    fly(autopilot, 0, 12_000, **frame)
    assert [event.late for event in kinds(autopilot, LocalWorld)] == [False]
    state = autopilot.telemetry.state_at(BootNs(11_850 * MS))
    expected = np.array((0.0, -2.0, -2.5)) + 11.85 * np.array(NED_VELOCITY)
    assert state.position_ned == pytest.approx(expected, abs=1e-3)
    assert state.velocity_ned == pytest.approx(NED_VELOCITY)
    assert state.position_drifts
    assert autopilot.telemetry.local_position_at(BootNs(11_850 * MS)) == pytest.approx(expected, abs=1e-3)


def test_odometry_is_used_only_where_no_local_position_comes():
    autopilot = Autopilot()
    fly(autopilot, 0, 12_000, local=True, **NED)
    assert autopilot.telemetry.state_at(BootNs(11_900 * MS)).position_ned[0] == pytest.approx(100.0)
    fly(autopilot, 12_000, 13_500, **NED)
    assert autopilot.telemetry.state_at(BootNs(13_400 * MS)).position_ned[0] == pytest.approx(1.7 * 13.4)


@pytest.mark.parametrize(
    ("fields", "name"),
    [
        ({"frame_id": 20}, "ODOMETRY (LOCAL_FRD)"),
        ({"frame_id": 4}, "ODOMETRY (frame)"),
        ({"child_frame_id": 8}, "ODOMETRY (frame)"),
        ({"estimator_type": 3}, "ODOMETRY (estimator_type)"),
        ({"quality": -1}, "ODOMETRY (quality)"),
        ({"time_usec": 1_790_000_000_000_000}, "ODOMETRY (time_usec)"),
        ({"x": float("nan")}, "ODOMETRY"),
        ({"vy": float("nan")}, "ODOMETRY"),
        ({"child_frame_id": 12, "q": (float("nan"), 0.0, 0.0, 0.0)}, "ODOMETRY"),
        ({"child_frame_id": 12, "q": (0.0, 0.0, 0.0, 0.0)}, "ODOMETRY"),
        ({"child_frame_id": 12, "q": (0.9, 0.0, 0.0, 0.0)}, "ODOMETRY"),
    ],
)
def test_odometry_that_is_no_local_position_of_the_autopilot_is_refused_by_name(fields, name):
    autopilot = Autopilot()
    fly(autopilot, 0, 12_000, **fields)
    assert kinds(autopilot, RelativeWorld) == [RelativeWorld()]
    assert kinds(autopilot, LocalWorld) == []
    refused = autopilot.telemetry.status(autopilot.host(12_000)).refused
    assert list(refused) == [name]
    assert refused[name] >= 118, "all but the first, which come before the clock is known"


@pytest.mark.parametrize(
    ("counters", "step_m", "jump_m"),
    [((0, 1), 0.4, [0.4]), ((255, 0), 0.4, [0.4]), ((7, 7), 0.4, []), ((0, 1), 0.0, []), ((3, 3), 2.0, [2.0])],
)
def test_step_of_the_position_is_a_jump_from_a_decimetre_where_the_reset_counter_changed(counters, step_m, jump_m):
    autopilot = Autopilot()
    before, after = counters
    fly(autopilot, 0, 12_000, reset_counter=before, **NED)
    x = 1.7 * 12.0 + step_m
    autopilot.send("ODOMETRY", 12_000, **NED, x=x, y=-2.0 + 4.8, z=-2.5 - 2.4, reset_counter=after)
    jumps = kinds(autopilot, PositionJumped)
    assert [jump.north_m for jump in jumps] == pytest.approx(jump_m)
    assert [jump.east_m for jump in jumps] == pytest.approx([0.0] * len(jumps), abs=1e-9)


def test_odometrys_longer_stamps_lie_on_the_time_line_after_49_days():
    start_ms = 2**32 // 1000 * 1000 + 2_000
    autopilot = Autopilot()
    fly(autopilot, start_ms, start_ms + 12_000, start_ms=start_ms, **NED)
    assert len(kinds(autopilot, LocalWorld)) == 1
    boot_ns = BootNs((start_ms + 11_850 - 2**32) * MS)
    assert autopilot.telemetry.state_at(boot_ns).position_ned[0] == pytest.approx(1.7 * 11.85, abs=1e-3)
