"""The truth of a simulated flight: the vehicle's path, its fisheye, and the size of every error.

Independent of the package: numpy and scipy, a lens inverted by iteration. Everything else follows from the values here:
``simulated_autopilot`` reports the flight with its errors, ``simulated_world`` sees it through the camera.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from fwav_companion.types import BIAS_COUNT, Bias, ErrorPriors

FOCAL = 3.55 * 188.0
CUBIC = 0.03 * 188.0
BODY_FROM_CAMERA = Rotation.from_matrix([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
"""Configured mount: the camera looks along body down, image top to the nose."""


def priors(**sigmas) -> ErrorPriors:
    """The priors of the figure-eight flights; by name of a Bias in lower case, or of a noise."""
    noise = {"pixel_noise_px": 4.0, "attitude_noise": np.radians(0.1), "position_noise_m": 0.0, "height_noise_m": 0.1}
    noise |= {name: sigmas.pop(name) for name in list(sigmas) if name in noise}
    wander = sigmas.pop("position_bias_time_s", 60.0)
    by_name = {
        "heading": np.radians(2.0), "mount_x": np.radians(1.0), "mount_y": np.radians(1.0), "mount_z": np.radians(1.0),
        "time_offset": 0.05,
    }  # fmt: skip
    by_name |= sigmas
    values = tuple(float(by_name.get(bias.name.lower(), 0.0)) for bias in Bias)
    return ErrorPriors(bias_sigmas=values, position_bias_time_s=wander, **noise)


@dataclass
class Flight:
    """The truth of one flight, and the errors of the reports about it."""

    seconds: float = 60.0
    fps: float = 30.0
    height_m: float = 12.0
    shape: str = "eight"  # eight | hover | turns (a turn, a climb of 5 m, another turn) | descent (from 15 m to 1 m)
    flapping_deg: float = 5.0
    flapping_hz: float = 5.0
    pitch_deg: float = 37.0
    attitude_hz: float = 50.0
    stamp_late_s: float = 0.0025
    late_by: float | None = None
    """Lateness of stamps beyond its mean, the same for every attitude, s; None: drawn for each attitude, uniformly."""
    targets: tuple = ((2.0, 3.0),)
    velocities: tuple = ((0.0, 0.0),)
    labels: tuple = ("",)
    seed: int = 1
    pixel_px: float = 4.0
    priors: ErrorPriors = field(default_factory=priors)
    biases: np.ndarray = field(default_factory=lambda: np.zeros(BIAS_COUNT))
    """True value of each Bias: estimate (configured, reported) minus truth for angles, height and position."""
    miss: float = 0.0
    clutter: float = 0.0
    gross: float = 0.0
    heading_wander: float = 0.0
    """One sigma of a Gauss-Markov error of the reported heading, in addition to its constant error, rad."""
    heading_wander_s: float = 20.0
    smooth_wander: bool = False
    """Whether the vehicle's position wanders as receivers do, with a rate of its own; else as a first-order
    Gauss-Markov process, which moves by 0.18 m within a second where this one moves by 0.03 m (1 m over 60 s)."""
    start: tuple = (0.0, 0.0, 0.0)
    """Start of the hover: north, east, heading."""

    def drawn(self, seed: int) -> Flight:
        """The same flight with biases from the priors."""
        rng = np.random.default_rng(10_000 + seed)
        return replace(self, seed=seed, biases=rng.standard_normal(BIAS_COUNT) * np.array(self.priors.bias_sigmas))


def path(flight: Flight, t):
    """True camera position NED and yaw, pitch, roll at the times t."""
    t = np.asarray(t, float)
    flap = np.radians(flight.flapping_deg) * np.sin(2 * np.pi * flight.flapping_hz * t)
    pitch = np.radians(flight.pitch_deg) + flap
    climb = 0.0 * t
    if flight.shape in ("turns", "descent"):
        n0, e0, heading = flight.start
        sway = np.radians(2.0)
        north, east = n0 + 0.1 * np.sin(0.8 * t), e0 + 0.1 * np.sin(0.65 * t + 0.5)
        yaw, roll = heading + sway * np.sin(0.5 * t), sway * np.sin(0.9 * t + 1.0)
        pitch = pitch + sway * np.sin(1.1 * t + 2.0)
        if flight.shape == "turns":
            climb = 5.0 * _eased(t, 22.0, 30.0)
            yaw = yaw + 2.0 * np.pi * (_eased(t, 3.0, 21.0) + _eased(t, 31.0, 49.0))
        else:
            gone = _eased(t, 3.0, 42.0)
            climb, north, east = -14.0 * gone, north * (1.0 - gone), east * (1.0 - gone)
    elif flight.shape == "hover":
        n0, e0, heading = flight.start
        north, east = n0 + 0 * t, e0 + 0 * t
        yaw = heading + np.radians(2.0) * np.sin(0.7 * t)
        roll = np.radians(1.0) * np.sin(0.9 * t + 1.0)
    else:
        a, b = 22.0, 11.0
        w = 5.0 / 19.5  # about 5 m/s along a lemniscate-like Lissajous figure of these half axes
        north, east = a * np.sin(w * t), b * np.sin(2 * w * t)
        vn, ve = a * w * np.cos(w * t), 2 * b * w * np.cos(2 * w * t)
        an, ae = -a * w * w * np.sin(w * t), -4 * b * w * w * np.sin(2 * w * t)
        yaw = np.unwrap(np.arctan2(ve, vn)) if t.ndim else np.arctan2(ve, vn)
        roll = np.arctan((vn * ae - ve * an) / np.hypot(vn, ve) / 9.81)
    down = -flight.height_m - climb
    return np.stack([north, east, down], -1), np.stack([yaw, pitch, roll], -1)


def _eased(t, start, end):
    """0 before ``start``, 1 after ``end``, smooth between."""
    x = np.clip((t - start) / (end - start), 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


def pixel_from_camera(d):
    """(N, 3) camera points -> (N, 2) pixels."""
    theta = np.arctan2(np.hypot(d[:, 0], d[:, 1]), d[:, 2])
    phi = np.arctan2(d[:, 1], d[:, 0])
    r = FOCAL * theta + CUBIC * theta**3
    return np.stack([320 + r * np.cos(phi), 240 + r * np.sin(phi)], -1)


def camera_from_pixel(uv):
    """(N, 2) pixels -> (N, 3) unit rays."""
    dx, dy = uv[:, 0] - 320, uv[:, 1] - 240
    r, phi = np.hypot(dx, dy), np.arctan2(dy, dx)
    theta = r / FOCAL
    for _ in range(8):
        theta -= (FOCAL * theta + CUBIC * theta**3 - r) / (FOCAL + 3 * CUBIC * theta**2)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
