"""Telemetry and sightings of a simulated flight for the estimator, with planted errors.

Independent of the package's projection: scipy's rotations, the truth of ``simulated_flight``. Errors are reported minus
true, in the order that ``PLANTED`` names.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation
from simulated_flight import BODY_FROM_CAMERA, Flight, camera_from_pixel, path, pixel_from_camera

from fwav_companion.estimation.errors import SampleNoise, priors
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.kept_sightings import frame_of, joined
from fwav_companion.estimation.problem import Problem
from fwav_companion.estimation.wander import place_knots

PLANTED = (
    "camera delay", "mount x", "mount y", "mount z", "heading", "roll", "pitch", "height", "position delay", "lever x",
    "lever y", "lever z", "readout",
)  # fmt: skip


@dataclass
class Planted:
    """A flight with errors; `wander` (north, east) of a receiver, one sigma."""

    flight: Flight
    errors: np.ndarray = field(default_factory=lambda: np.zeros(13))
    wander_m: float = 0.0
    wander_s: float = 60.0
    position_noise_m: float = 0.02
    height_noise_m: float = 0.1
    velocity_noise_m_s: float = 0.02
    attitude_noise: float = np.radians(0.1)
    position_hz: float = 10.0
    jump_m: float = 0.0
    period_s: float = 0.0  # between frames; 0: by the flight's rate
    target_heights_m: tuple = ()  # of the targets above the origin; empty: zero

    def telemetry(self):
        """(attitudes, positions): lists of (stamp, quaternion wxyz), and of (stamp, north east height, velocity)."""
        rng = np.random.default_rng(self.flight.seed + 500)
        f, e = self.flight, self.errors
        t = np.arange(-1.0, f.seconds + 1.0, 1 / f.attitude_hz)
        _, ypr = path(f, t)
        true = Rotation.from_euler("ZYX", ypr)
        reported = reported_attitude(true, ypr, e) * Rotation.from_rotvec(
            rng.standard_normal((len(t), 3)) * self.attitude_noise
        )
        stamps = t + rng.uniform(0, f.stamp_late_s, len(t))
        attitudes = list(zip(stamps, reported.as_quat()[:, [3, 0, 1, 2]], strict=True))

        p = np.arange(-1.0, f.seconds + 1.0, 1 / self.position_hz)
        camera, ypr = path(f, p)
        step = 1e-4
        velocity = (path(f, p + step)[0] - path(f, p - step)[0]) / (2 * step) * [1, 1, -1]
        place = camera * [1, 1, -1]
        place[:, :2] += self._wander(p, rng) + rng.standard_normal((len(p), 2)) * self.position_noise_m
        place[:, 2] += e[7] + rng.standard_normal(len(p)) * self.height_noise_m
        lever = Rotation.from_euler("ZYX", ypr).apply(e[9:12])
        place += lever * [1, 1, -1]
        place[p > 0.6 * f.seconds, :2] += self.jump_m
        velocity = velocity + rng.standard_normal(velocity.shape) * self.velocity_noise_m_s
        return attitudes, list(zip(p + e[8], place, velocity, strict=True))

    def _wander(self, t, rng):
        """Second-order wander, as receivers have it: (N, 2)."""
        if self.wander_m == 0:
            return np.zeros((len(t), 2))
        lag = np.abs(t[:, None] - t)
        x = 2 * lag / self.wander_s
        k = (1 + x) * np.exp(-x) + 1e-9 * np.eye(len(t))
        return self.wander_m * np.linalg.cholesky(k) @ rng.standard_normal((len(t), 2))

    def frames(self, pixel_px=None):
        """List of (stamp, Sightings with true targets)."""
        f, e = self.flight, self.errors
        rng = np.random.default_rng(f.seed + 900)
        capture = np.arange(0.0, f.seconds, self.period_s or 1 / f.fps)
        camera, ypr = path(f, capture)
        true_mount = Rotation.from_rotvec(e[1:4]).inv() * BODY_FROM_CAMERA
        camera_from_ned = (Rotation.from_euler("ZYX", ypr) * true_mount).inv()
        found = [[] for _ in capture]
        heights = self.target_heights_m or (0.0,) * len(f.targets)
        for number, (target, velocity) in enumerate(zip(f.targets, f.velocities, strict=True)):
            down = 0 * capture - heights[number]
            where = np.stack([target[0] + velocity[0] * capture, target[1] + velocity[1] * capture, down], -1)
            d = camera_from_ned.apply(where - camera)
            uv = pixel_from_camera(d)
            inside = (np.abs(uv[:, 0] - 319.5) < 320) & (np.abs(uv[:, 1] - 239.5) < 240) & (d[:, 2] > 0)
            uv = uv + rng.standard_normal(uv.shape) * (f.pixel_px if pixel_px is None else pixel_px)
            rays, tangents = standardised(uv, f.pixel_px)
            for k in np.flatnonzero(inside):
                found[k].append((number, rays[:, k], tangents[..., k]))
        frames = []
        for k, seen in enumerate(found):
            if not seen:
                continue
            stamp = float(capture[k] + e[0])
            rays, tangents = np.stack([s[1] for s in seen], -1), np.stack([s[2] for s in seen], -1)
            frame = frame_of(k, np.full(len(seen), stamp), rays, tangents)
            frames.append((stamp, frame.with_targets(np.array([s[0] for s in seen], np.int64))))
        return frames


def reported_attitude(true, ypr, errors):
    """The attitude with the errors of heading, roll and pitch; roll about the body's x, pitch about the level y."""
    level = Rotation.from_euler("Z", ypr[:, :1]).apply([0.0, 1.0, 0.0])
    heading = Rotation.from_euler("Z", errors[4])
    return heading * Rotation.from_rotvec(level * errors[6]) * true * Rotation.from_rotvec([errors[5], 0.0, 0.0])


def standardised(uv, sigma_px):
    """Unit rays (3, N) in body axes of pixels (N, 2), and tangents (2, 3, N) by finite differences of the lens."""
    rays = camera_from_pixel(uv)
    right, below = np.array([0.01, 0.0]), np.array([0.0, 0.01])
    du = (camera_from_pixel(uv + right) - camera_from_pixel(uv - right)) / 0.02
    dv = (camera_from_pixel(uv + below) - camera_from_pixel(uv - below)) / 0.02
    body = BODY_FROM_CAMERA
    rays, columns = body.apply(rays).T, np.stack([body.apply(du), body.apply(dv)], -1)  # (N, 3, 2)
    return rays, np.moveaxis(np.linalg.pinv(columns) / sigma_px, 0, -1)


def problem_of(planted, noise, **knots):
    """The least squares of the whole flight, by true targets; `knots`: options of `place_knots`."""
    estimator = Estimator(priors(), noise)
    attitudes, positions = planted.telemetry()
    for sample in attitudes:
        estimator.add_attitude(*sample)
    for sample in positions:
        estimator.add_position(*sample)
    estimator._path.settle()
    s = joined([frame for _, frame in planted.frames()])
    return Problem(estimator.model, estimator.carrier, s, place_knots(s.t, float(s.t[-1]), [], **knots))


def flown(planted, priors, noise=None, *, observe=None, take_over_s=0.0, **options):
    """The estimator after the flight, frames with true targets; `observe(estimator, stamp)` after every frame.

    take_over_s: time from a solve's start to its take-over; 0: at once.
    """
    noise = noise or SampleNoise(
        attitude_rad=planted.attitude_noise, attitude_stamp_delay_s=planted.flight.stamp_late_s,
        position_m=planted.position_noise_m, height_m=planted.height_noise_m, position_wander_m=planted.wander_m,
    )  # fmt: skip
    estimator, pending = Estimator(priors, noise, **options), []
    attitudes, positions = planted.telemetry()
    events = [(t + 0.05, 0, (t, q)) for t, q in attitudes] + [(t + 0.05, 1, (t, p, v)) for t, p, v in positions]
    events += [(t + 0.25, 2, (t, s)) for t, s in planted.frames()]
    for _, kind, value in sorted(events, key=lambda event: event[:2]):
        if kind == 0:
            estimator.add_attitude(*value)
        elif kind == 1:
            estimator.add_position(*value)
        else:
            stamp, s = value
            estimator.update(s)
            if pending and stamp >= pending[0].t + take_over_s:
                estimator.adopt(pending.pop().run())
            if not pending and estimator.is_solve_due(stamp):
                pending.append(estimator.start_solve(stamp))
                if take_over_s == 0:
                    estimator.adopt(pending.pop().run())
            if observe is not None:
                observe(estimator, stamp)
    return estimator
