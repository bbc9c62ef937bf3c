"""A gimbal that carries the camera: level with the horizon, slewed slowly, stamped by its own clock."""

from __future__ import annotations

from math import cos, nan, pi, radians, sin
from random import Random
from typing import Any

from sitl_mock.draws import DrawnBiases
from sitl_mock.flight import Flight
from sitl_mock.options import Options
from sitl_mock.rotation import Matrix, Vector, matrix_from_euler, quaternion_from_euler

MESSAGE = "GIMBAL_DEVICE_ATTITUDE_STATUS"
BEHIND_AUTOPILOT = 6
"""Largest gimbal_device_id of a gimbal whose messages the autopilot sends, stamped by the autopilot's clock."""
SWING_HZ = 0.15
ROLL_LOCK_AND_PITCH_LOCK, YAW_LOCK, YAW_IN_VEHICLE_FRAME, YAW_IN_EARTH_FRAME = 12, 16, 32, 64
FLAGS = {
    "north": YAW_IN_EARTH_FRAME,
    "vehicle": YAW_IN_VEHICLE_FRAME,
    "vehicle_and_delta": YAW_IN_VEHICLE_FRAME,
    "old_lock": YAW_LOCK,
    "old_follow": 0,
}
"""Yaw flags of the message by ``gimbal.yaw``; the old styles have neither frame flag, and their delta_yaw has no
meaning."""


class Gimbal:
    """Orientation of the gimbal, and the message that reports it."""

    def __init__(self, options: Options, biases: DrawnBiases, flight: Flight) -> None:
        self._o, self._biases, self._flight = options.gimbal, biases, flight
        self._noise = options.priors.attitude_noise_deg
        self._rng = Random(f"{options.seed}/gimbal")
        if self._o.yaw not in FLAGS:
            raise KeyError(f"no gimbal.yaw {self._o.yaw!r}: one of {', '.join(FLAGS)}")

    def ned_from_gimbal(self, flight_s: float) -> Matrix:
        """True orientation; x is the optical axis, y the image's right."""
        pitch, yaw = self._angles(flight_s)
        return matrix_from_euler(0.0, pitch, yaw + self._flight.euler(flight_s)[2])

    def fields(self, flight_s: float, stamp_ms: int) -> dict[str, Any]:
        """Fields of the message: with the gimbal's own errors, and the heading's error where yaw counts from north."""
        pitch, yaw = self._angles(flight_s)
        heading = self._flight.euler(flight_s)[2] + radians(self._biases.heading_deg)
        if self._o.yaw in ("north", "old_lock"):
            yaw += heading
        euler: Vector = (
            radians(self._biases.attitude_roll_deg) + self._fresh(),
            pitch + radians(self._biases.attitude_pitch_deg) + self._fresh(),
            yaw + self._fresh(),
        )
        delta_yaw = {"vehicle_and_delta": heading, "vehicle": nan, "north": nan}.get(self._o.yaw, 1.0)
        return {
            "target_system": 0,
            "target_component": 0,
            "time_boot_ms": stamp_ms % 2**32,
            "flags": ROLL_LOCK_AND_PITCH_LOCK | FLAGS[self._o.yaw],
            "q": list(quaternion_from_euler(*euler)),
            "angular_velocity_x": nan,
            "angular_velocity_y": nan,
            "angular_velocity_z": nan,
            "failure_flags": 0,
            "delta_yaw": delta_yaw,
            "delta_yaw_velocity": nan,
            "gimbal_device_id": self._o.device_id if self._o.device_id <= BEHIND_AUTOPILOT else 0,
        }

    def _angles(self, t: float) -> tuple[float, float]:
        """Pitch, and yaw from the vehicle's heading, radians."""
        w = 2.0 * pi * SWING_HZ
        pitch_deg = self._o.pitch_deg + self._o.swing_deg * sin(w * t)
        return radians(pitch_deg), radians(self._o.yaw_deg + self._o.swing_deg * cos(0.7 * w * t))

    def _fresh(self) -> float:
        return radians(self._rng.gauss(0.0, self._noise)) if self._noise else 0.0
