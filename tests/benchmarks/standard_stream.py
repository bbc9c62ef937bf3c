"""The standard stream: 102 messages a second as an autopilot sends them, packed by pymavlink."""

from __future__ import annotations

import io
import random
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

SHARES = {
    "ATTITUDE": 50,
    "GLOBAL_POSITION_INT": 10,
    "ALTITUDE": 10,
    "RAW_IMU": 10,
    "PARAM_VALUE": 10,
    "SERVO_OUTPUT_RAW": 5,
    "VFR_HUD": 4,
    "SYS_STATUS": 2,
    "HEARTBEAT": 1,
}
"""Messages a second."""
WANTED = frozenset({"HEARTBEAT", "ATTITUDE", "GLOBAL_POSITION_INT", "ALTITUDE"})


def _makers(mav: Any, rng: random.Random) -> dict[str, Callable[[int], Any]]:
    def r() -> float:
        return rng.uniform(-1.0, 1.0)

    return {
        "ATTITUDE": lambda t: mav.attitude_encode(t, r(), r(), r(), r(), r(), r()),
        "GLOBAL_POSITION_INT": lambda t: mav.global_position_int_encode(
            t, 473_000_000 + t, 85_000_000 - t, 500_000, 10_000, 120, -30, 5, 27_000
        ),
        "ALTITUDE": lambda t: mav.altitude_encode(t * 1000, 1 + r(), 2 + r(), r(), r(), r(), r()),
        "RAW_IMU": lambda t: mav.raw_imu_encode(t * 1000, 1, -2, 980, 4, 5, 6, 170, 180, 190),
        "PARAM_VALUE": lambda t: mav.param_value_encode(b"PTCH_TRIM_DEG", r(), 9, 1100, t % 1100),
        "SERVO_OUTPUT_RAW": lambda t: mav.servo_output_raw_encode(t * 1000 & 0xFFFFFFFF, 0, *range(1500, 1508)),
        "VFR_HUD": lambda t: mav.vfr_hud_encode(8 + r(), 8 + r(), 270, 55, 10 + r(), r()),
        "SYS_STATUS": lambda t: mav.sys_status_encode(7, 7, 7, 300, 11_800, 1500, 80, 0, 0, 0, 0, 0, 0),
        "HEARTBEAT": lambda t: mav.heartbeat_encode(16, 3, 81, 0, 4),
    }


def frames(count: int) -> list[bytes]:
    """The first ``count`` frames, from (1, 1), in a fixed pseudo-random order by their shares."""
    rng = random.Random(1)
    mav = dialect.MAVLink(io.BytesIO(), srcSystem=1, srcComponent=1)
    makers = _makers(mav, rng)
    names = rng.choices(list(SHARES), weights=list(SHARES.values()), k=count)
    packed = []
    for i, name in enumerate(names):
        mav.seq = i % 256
        packed.append(makers[name](1000 + i * 10).pack(mav))
    return packed
