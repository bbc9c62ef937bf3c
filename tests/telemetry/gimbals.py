"""A gimbal's messages by hand, and the gimbal that heard them: shared by the tests of its attitude."""

from collections import namedtuple
from math import nan

from scipy.spatial.transform import Rotation

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.telemetry.attitude.history import AttitudeAt
from fwav_companion.telemetry.clock.clock import Clock
from fwav_companion.telemetry.gimbal import Gimbal

Fields = namedtuple("Fields", "time_boot_ms flags q delta_yaw gimbal_device_id")
EARTH, LOCKS = 64, 12
NO_TURN = (1.0, 0.0, 0.0, 0.0)
LEVEL = AttitudeAt(NO_TURN, (0.0, 0.0, 0.0), 0.0, 0.0)
BOOT_S, GIMBAL_S = 30.0, 700.0
"""Readings of the clocks at the host's zero."""


def fields(t_s, q, flags=EARTH, delta_yaw=nan, device_id=0):
    return Fields(round((GIMBAL_S + t_s) * 1e3), flags, tuple(q), delta_yaw, device_id)


def look(t_s):
    """A slow slew: pitch and yaw at even rates."""
    return Rotation.from_euler("ZYX", [10.0 + 8.0 * t_s, -60.0 + 5.0 * t_s, 1.0], degrees=True)


def quaternion(rotation):
    x, y, z, w = rotation.as_quat()
    return (w, x, y, z)


def autopilot_clock():
    clock = Clock()
    for k in range(60):
        clock.on_arrival(BootNs(round((BOOT_S + 0.1 * k) * 1e9)), HostNs(round(0.1e9 * k)))
    return clock


def fed(rate_hz=5.0, seconds=5.0, turn=look, **how):
    gimbal = Gimbal(154)
    for k in range(round(seconds * rate_hz) + 1):
        t_s = k / rate_hz
        gimbal.on_message(fields(t_s, quaternion(turn(t_s)), **how), HostNs(round(t_s * 1e9)))
    return gimbal


def asked(gimbal, t_s, body=LEVEL):
    return gimbal.at(BootNs(round((BOOT_S + t_s) * 1e9)), autopilot_clock(), body)
