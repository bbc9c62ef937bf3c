"""The autopilot's report of a simulated flight: attitudes and positions with every error of the flight.

Independent of the package's telemetry: Euler angles through a spline, rates as its derivatives.
"""

from __future__ import annotations

import numpy as np
from handmade import BOOT_NS, a_state
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation
from simulated_flight import Flight, path

from fwav_companion.types import Bias, Reason, Unpaired

POSITION = [Bias.POSITION_NORTH, Bias.POSITION_EAST]


class Autopilot:
    """A flight as the autopilot reports it: a history that can be evaluated at any instant."""

    def __init__(self, flight: Flight, rng: np.random.Generator) -> None:
        """``rng``: the generator of the flight's seed; the camera's detections are drawn from it afterwards."""
        self.flight, self.rng = flight, rng
        times = np.arange(-1.0, flight.seconds + 1.0, 1 / flight.attitude_hz)
        reported = self._attitudes(times)
        late = rng.uniform(0, flight.stamp_late_s, len(times)) - flight.stamp_late_s / 2
        if flight.late_by is not None:
            late = np.full(len(times), flight.late_by)
        self.euler = CubicSpline(times + late, np.unwrap(reported.as_euler("ZYX"), axis=0))
        self.euler_rate = self.euler.derivative()
        self.slow = np.arange(-1.0, flight.seconds + 1.1, 0.1)
        self.height_noise = rng.standard_normal(len(self.slow)) * flight.priors.height_noise_m
        self.position_noise = rng.standard_normal((len(self.slow), 2)) * flight.priors.position_noise_m
        self.wander = self._wandering(self.slow)

    def reported(self, t):
        """Reported rotation, position, rates, velocity and angular acceleration of the camera at the times t."""
        t = np.asarray(t, float)
        ypr, rate = self.euler(t), self.euler_rate(t)
        position, _ = path(self.flight, t)
        ahead, _ = path(self.flight, t + 1e-3)
        velocity = (ahead - position) / 1e-3
        noise_n = np.interp(t, self.slow, self.position_noise[:, 0] + self.wander[:, 0])
        noise_e = np.interp(t, self.slow, self.position_noise[:, 1] + self.wander[:, 1])
        height = np.interp(t, self.slow, self.height_noise) + self.flight.biases[Bias.HEIGHT]
        position = position + np.stack([noise_n, noise_e, -height], -1)
        later, before = (_body_rates(self.euler(at), self.euler_rate(at)) for at in (t + 1e-4, t - 1e-4))
        return Rotation.from_euler("ZYX", ypr), position, _body_rates(ypr, rate), velocity, (later - before) / 2e-4

    def state_at(self, boot_ns):
        """The vehicle's state, in the form of telemetry."""
        t = (boot_ns - BOOT_NS) * 1e-9
        if not -0.9 < t < self.flight.seconds + 0.9:
            return Unpaired(Reason.STALE_ATTITUDE)
        rotation, *others = self.reported([t])
        position, rates, velocity, acceleration = (each[0] for each in others)
        return a_state(
            boot_ns,
            rotation.as_quat()[0],
            rates,
            position,
            velocity,
            *self.stamping,
            acceleration=acceleration,
            frequency=self.frequency,
        )

    @property
    def frequency(self):
        """Angular frequency of the wing beat, rad/s."""
        return 2.0 * np.pi * self.flight.flapping_hz

    @property
    def stamping(self):
        """(seconds between attitudes, sigma of their stamps in seconds); the sigma is reported where all are equally
        late.
        """
        flight = self.flight
        return 1.0 / flight.attitude_hz, 0.0 if flight.late_by is None else flight.stamp_late_s / np.sqrt(12)

    def _attitudes(self, times):
        flight, b = self.flight, self.flight.biases
        _, ypr = path(flight, times)
        noise = self.rng.standard_normal((len(times), 3)) * flight.priors.attitude_noise
        return (
            Rotation.from_rotvec(np.outer(b[Bias.HEADING] + self._heading_wander(times), [0, 0, 1]))
            * Rotation.from_euler("ZYX", ypr)
            * Rotation.from_rotvec(np.array([b[Bias.ROLL], b[Bias.PITCH], 0]) + noise)
        )

    def _wandering(self, times):
        if self.flight.smooth_wander:
            return self._smoothly_wandering(times)
        keep = np.exp(-(times[1] - times[0]) / self.flight.priors.position_bias_time_s)
        sigma = np.array(self.flight.priors.bias_sigmas)[POSITION]
        scale = sigma * np.any(self.flight.biases[POSITION] != 0)
        values = [self.rng.standard_normal(2) * scale]
        for _ in times[1:]:
            values.append(keep * values[-1] + np.sqrt(1 - keep**2) * scale * self.rng.standard_normal(2))
        return np.array(values)

    def _smoothly_wandering(self, times):
        """Critically damped second-order process, whose integral time is that of the first-order one."""
        rate, step = 2.0 / self.flight.priors.position_bias_time_s, times[1] - times[0]
        moved = expm(np.array([[0.0, 1.0], [-(rate**2), -2.0 * rate]]) * step)
        stationary = np.diag([1.0, rate**2])
        drawn = np.linalg.cholesky(stationary - moved @ stationary @ moved.T)
        values = [np.sqrt(stationary) @ self.rng.standard_normal((2, 2))]
        for _ in times[1:]:
            values.append(moved @ values[-1] + drawn @ self.rng.standard_normal((2, 2)))
        scale = np.array(self.flight.priors.bias_sigmas)[POSITION] * np.any(self.flight.biases[POSITION] != 0)
        return np.array(values)[:, 0] * scale

    def _heading_wander(self, times):
        if not self.flight.heading_wander:
            return 0.0 * times
        keep = np.exp(-(times[1] - times[0]) / self.flight.heading_wander_s)
        rng = np.random.default_rng(20_000 + self.flight.seed)
        steps = rng.standard_normal(len(times)) * self.flight.heading_wander * np.sqrt(1 - keep**2)
        steps[0] /= np.sqrt(1 - keep**2)
        return lfilter([1.0], [1.0, -keep], steps)


def _body_rates(ypr, rate):
    """(N, 3) rates about the body's axes, from (N, 3) yaw, pitch, roll and their derivatives."""
    sp, cp = np.sin(ypr[:, 1]), np.cos(ypr[:, 1])
    sr, cr = np.sin(ypr[:, 2]), np.cos(ypr[:, 2])
    dy, dp, dr = rate.T
    return np.stack([dr - sp * dy, cr * dp + sr * cp * dy, -sr * dp + cr * cp * dy], -1)
