"""A gimbal that carries the camera: level with the horizon, slewed slowly, stamped by its own clock."""

from __future__ import annotations

from math import cos, degrees, nan, pi, radians, sin
from random import Random
from typing import Any

from sitl_mock.draws import DrawnBiases, radians3
from sitl_mock.flight import Flight
from sitl_mock.gimbal_motor import GimbalMotor, Look
from sitl_mock.options import Options
from sitl_mock.rotation import (
    Matrix,
    Vector,
    euler_from_matrix,
    matrix_from_euler,
    matrix_from_rotation_vector,
    quaternion_from_euler,
    times,
    transposed,
)

MESSAGE = "GIMBAL_DEVICE_ATTITUDE_STATUS"
BEHIND_AUTOPILOT = 6
"""Largest gimbal_device_id of a gimbal whose messages the autopilot sends, stamped by the autopilot's clock."""
SWING_HZ = 0.15
ROLL_LOCK_AND_PITCH_LOCK, YAW_LOCK, YAW_IN_VEHICLE_FRAME, YAW_IN_EARTH_FRAME = 12, 16, 32, 64
FLAGS = {
    "north": YAW_IN_EARTH_FRAME,
    "north_and_delta": YAW_IN_EARTH_FRAME,
    "vehicle": YAW_IN_VEHICLE_FRAME,
    "vehicle_and_delta": YAW_IN_VEHICLE_FRAME,
    "both_frames": YAW_IN_VEHICLE_FRAME | YAW_IN_EARTH_FRAME,
    "old_lock": YAW_LOCK,
    "old_follow": 0,
}
"""Yaw flags of the message by ``gimbal.yaw``; the old styles have neither frame flag, and their delta_yaw has no
meaning."""
FROM_NORTH = ("north", "north_and_delta", "old_lock")


class Gimbal:
    """Orientation of the gimbal, and the message that reports it."""

    def __init__(self, options: Options, biases: DrawnBiases, flight: Flight) -> None:
        self._o, self._biases, self._flight = options.gimbal, biases, flight
        self._noise = options.priors.attitude_noise_deg
        self._rng = Random(f"{options.seed}/gimbal")
        self._motor = GimbalMotor(self._o.command_delay_s, radians(self._o.rate_deg_s), frozen=self._o.frozen)
        if self._o.yaw not in FLAGS:
            raise KeyError(f"no gimbal.yaw {self._o.yaw!r}: one of {', '.join(FLAGS)}")

    def ned_from_gimbal(self, flight_s: float) -> Matrix:
        """True orientation; x is the optical axis, y the image's right."""
        pitch, yaw = self._angles(flight_s)
        return matrix_from_euler(0.0, pitch, yaw + self._flight.euler(flight_s)[2])

    def fields(self, flight_s: float, stamp_ms: int) -> dict[str, Any]:
        """Fields of the message: with the gimbal's own errors, and the heading's error where yaw counts from north."""
        of_s = flight_s - self._o.late_s - self._biases.gimbal_delay_s
        roll, pitch, yaw = self._reported(of_s)
        heading = self.own_heading(of_s)
        if self._o.yaw in FROM_NORTH:
            yaw += heading
        if self._o.message == "MOUNT_ORIENTATION":
            angles = {"roll": degrees(roll), "pitch": degrees(pitch), "yaw": degrees(yaw)}
            return {"time_boot_ms": stamp_ms % 2**32, **angles, "yaw_absolute": nan}
        broken = 0.0 < self._o.nan_from_s <= flight_s
        told = {"vehicle_and_delta": heading, "north_and_delta": heading, "vehicle": nan, "north": nan}
        return {
            "target_system": 0,
            "target_component": 0,
            "time_boot_ms": stamp_ms % 2**32,
            "flags": ROLL_LOCK_AND_PITCH_LOCK | FLAGS[self._o.yaw],
            "q": [nan] * 4 if broken else list(quaternion_from_euler(roll, pitch, yaw)),
            "angular_velocity_x": nan,
            "angular_velocity_y": nan,
            "angular_velocity_z": nan,
            "failure_flags": 0,
            "delta_yaw": told.get(self._o.yaw, 1.0),
            "delta_yaw_velocity": nan,
            "gimbal_device_id": self._o.device_id if self._o.device_id <= BEHIND_AUTOPILOT else 0,
        }

    def command(self, look: Look, t: float) -> None:
        """Turns it to a pitch and a yaw from the vehicle's heading, by its own measure."""
        self._motor.command(look, t, self.look(t))

    def look(self, t: float) -> Look:
        """Pitch, and yaw from the vehicle's heading, by its own measure, radians."""
        pitch, yaw = self._angles(t)
        return pitch + radians(self._biases.attitude_pitch_deg), yaw + radians(self._biases.gimbal_yaw_deg)

    def own_heading(self, t: float) -> float:
        """The gimbal's idea of the vehicle's heading, radians."""
        return self._flight.euler(t)[2] + radians(self._biases.heading_deg + self._o.yaw_zero_deg)

    def _reported(self, t: float) -> Vector:
        """Roll, pitch, and yaw from the vehicle, radians, with the gimbal's errors."""
        b = self._biases
        noise: Vector = (self._fresh(), self._fresh(), self._fresh())
        yaw_error = matrix_from_euler(0.0, 0.0, radians(b.gimbal_yaw_deg))
        if self._o.kind == "servo":  # the servos know nothing of the horizon: the error is the autopilot's own
            body = matrix_from_euler(*self._flight.euler(t))
            turned = times(transposed(body), self.ned_from_gimbal(t))
        else:
            tilt = radians3((b.attitude_roll_deg, b.attitude_pitch_deg, b.gimbal_third_deg))
            turned = times(matrix_from_euler(0.0, *self._angles(t)), matrix_from_rotation_vector(tilt))
        return euler_from_matrix(times(yaw_error, times(turned, matrix_from_rotation_vector(noise))))

    def _angles(self, t: float) -> tuple[float, float]:
        """Pitch, and yaw from the vehicle's heading, radians."""
        if self._motor.moves:
            pitch, yaw = self._motor.at(t)
            return pitch - radians(self._biases.attitude_pitch_deg), yaw - radians(self._biases.gimbal_yaw_deg)
        w, swing_deg = 2.0 * pi * SWING_HZ, 0.0 if self._o.frozen else self._o.swing_deg
        pitch_deg = self._o.pitch_deg + swing_deg * sin(w * t)
        return radians(pitch_deg), radians(self._o.yaw_deg + swing_deg * cos(0.7 * w * t))

    def _fresh(self) -> float:
        return radians(self._rng.gauss(0.0, self._noise)) if self._noise else 0.0
