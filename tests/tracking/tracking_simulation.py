"""A small world for the tracker: flights, a fisheye, an attitude stream with its faults, fixes by differences.

Independent of the package's localization: numpy and scipy, Euler splines, Jacobians by finite differences.
Truth is chosen first; what the tracker is given follows from it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from fwav_companion.nouns import (
    BIAS_COUNT,
    Bias,
    Detection,
    ErrorBudget,
    ErrorPriors,
    FrameView,
    GroundFix,
    Ray,
    Reason,
    Sighting,
    Unpaired,
    VehicleState,
)

FOCAL = 3.55 * 188.0
CUBIC = 0.03 * 188.0
BODY_FROM_CAMERA = Rotation.from_matrix([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
"""Looks along body down, image top to the nose."""
RIGHT, BELOW = np.array([0.01, 0]), np.array([0, 0.01])
EPOCH_NS = 1_790_000_000_000_000_000
BOOT_NS = 77_000_000_000


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
    """The truth of one flight, and the faults of what is told about it."""

    seconds: float = 60.0
    fps: float = 30.0
    height_m: float = 12.0
    shape: str = "eight"  # eight | hover
    flapping_deg: float = 5.0
    flapping_hz: float = 5.0
    pitch_deg: float = 37.0
    attitude_hz: float = 50.0
    stamp_late_s: float = 0.0025
    late_by: float | None = None
    """Of the mean lateness of stamps, s: the same of every attitude; None: of each another, evenly."""
    targets: tuple = ((2.0, 3.0),)
    velocities: tuple = ((0.0, 0.0),)
    labels: tuple = ("",)
    seed: int = 1
    pixel_px: float = 4.0
    priors: ErrorPriors = field(default_factory=priors)
    biases: np.ndarray = field(default_factory=lambda: np.zeros(BIAS_COUNT))
    """Truth of each Bias: estimate (configured, told) minus truth for angles, height and position."""
    miss: float = 0.0
    clutter: float = 0.0
    gross: float = 0.0
    heading_wander: float = 0.0
    """One sigma of a Gauss-Markov error of the told heading beside its constant one, rad."""
    heading_wander_s: float = 20.0
    start: tuple = (0.0, 0.0, 0.0)
    """Of the hover: north, east, heading."""

    def drawn(self, seed: int) -> Flight:
        """The same flight with biases from the priors."""
        rng = np.random.default_rng(10_000 + seed)
        return replace(self, seed=seed, biases=rng.standard_normal(BIAS_COUNT) * np.array(self.priors.bias_sigmas))


def path(flight: Flight, t):
    """True camera position NED and yaw, pitch, roll at the times t."""
    t = np.asarray(t, float)
    flap = np.radians(flight.flapping_deg) * np.sin(2 * np.pi * flight.flapping_hz * t)
    pitch = np.radians(flight.pitch_deg) + flap
    if flight.shape == "hover":
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
    down = -flight.height_m + 0 * t
    return np.stack([north, east, down], -1), np.stack([yaw, pitch, roll], -1)


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


def on_ground(camera, ray):
    """Where rays NED meet down = 0."""
    return camera - ray * (camera[:, 2:3] / ray[:, 2:3])


class World:
    """One flight, told: frames for the tracker, and a history that can be asked."""

    def __init__(self, flight: Flight) -> None:
        self.flight = flight
        self.rng = np.random.default_rng(flight.seed)
        b = flight.biases
        self.attitude_bias = b[[Bias.ROLL, Bias.PITCH]]
        times = np.arange(-1.0, flight.seconds + 1.0, 1 / flight.attitude_hz)
        _, ypr = path(flight, times)
        noise = self.rng.standard_normal((len(times), 3)) * flight.priors.attitude_noise
        true = Rotation.from_euler("ZYX", ypr)
        told = (
            Rotation.from_rotvec(np.outer(b[Bias.HEADING] + self._heading_wander(times), [0, 0, 1]))
            * true
            * Rotation.from_rotvec(np.array([b[Bias.ROLL], b[Bias.PITCH], 0]) + noise)
        )
        late = self.rng.uniform(0, flight.stamp_late_s, len(times)) - flight.stamp_late_s / 2
        if flight.late_by is not None:
            late = np.full(len(times), flight.late_by)
        euler = np.unwrap(told.as_euler("ZYX"), axis=0)
        self.euler = CubicSpline(times + late, euler)
        self.euler_rate = self.euler.derivative()
        slow = np.arange(-1.0, flight.seconds + 1.1, 0.1)
        self.height_noise = self.rng.standard_normal(len(slow)) * flight.priors.height_noise_m
        self.position_noise = self.rng.standard_normal((len(slow), 2)) * flight.priors.position_noise_m
        self.wander = self._wandering(slow)
        self.slow = slow

    @property
    def _stamping(self):
        """Seconds between attitudes, and what their stamps leave open, which is told where they are all as late."""
        flight = self.flight
        return 1.0 / flight.attitude_hz, 0.0 if flight.late_by is None else flight.stamp_late_s / np.sqrt(12)

    def _wandering(self, times):
        keep = np.exp(-(times[1] - times[0]) / self.flight.priors.position_bias_time_s)
        sigma = np.array(self.flight.priors.bias_sigmas)[[Bias.POSITION_NORTH, Bias.POSITION_EAST]]
        scale = sigma * np.any(self.flight.biases[[Bias.POSITION_NORTH, Bias.POSITION_EAST]] != 0)
        values = [self.rng.standard_normal(2) * scale]
        for _ in times[1:]:
            values.append(keep * values[-1] + np.sqrt(1 - keep**2) * scale * self.rng.standard_normal(2))
        return np.array(values)

    def _heading_wander(self, times):
        if not self.flight.heading_wander:
            return 0.0 * times
        keep = np.exp(-(times[1] - times[0]) / self.flight.heading_wander_s)
        rng = np.random.default_rng(20_000 + self.flight.seed)
        steps = rng.standard_normal(len(times)) * self.flight.heading_wander * np.sqrt(1 - keep**2)
        steps[0] /= np.sqrt(1 - keep**2)
        return lfilter([1.0], [1.0, -keep], steps)

    def told(self, t):
        """What the autopilot tells of the camera at the times t: rotation, position, rates, velocity."""
        t = np.asarray(t, float)
        ypr, rate = self.euler(t), self.euler_rate(t)
        position, _ = path(self.flight, t)
        ahead, _ = path(self.flight, t + 1e-3)
        velocity = (ahead - position) / 1e-3
        noise_n = np.interp(t, self.slow, self.position_noise[:, 0] + self.wander[:, 0])
        noise_e = np.interp(t, self.slow, self.position_noise[:, 1] + self.wander[:, 1])
        height = np.interp(t, self.slow, self.height_noise) + self.flight.biases[Bias.HEIGHT]
        position = position + np.stack([noise_n, noise_e, -height], -1)
        sp, cp = np.sin(ypr[:, 1]), np.cos(ypr[:, 1])
        sr, cr = np.sin(ypr[:, 2]), np.cos(ypr[:, 2])
        dy, dp, dr = rate.T
        rates = np.stack([dr - sp * dy, cr * dp + sr * cp * dy, -sr * dp + cr * cp * dy], -1)
        return Rotation.from_euler("ZYX", ypr), position, rates, velocity

    def state_at(self, boot_ns):
        """As telemetry answers."""
        t = (boot_ns - BOOT_NS) * 1e-9
        if not -0.9 < t < self.flight.seconds + 0.9:
            return Unpaired(Reason.STALE_ATTITUDE)
        rotation, position, rates, velocity = self.told([t])
        return _state(
            boot_ns, rotation.as_quat()[0], rates[0], position[0], velocity[0], *self._stamping
        )  # fmt: skip

    def frames(self) -> list[FrameView]:
        """Everything the camera saw, localized as configured."""
        flight, rng = self.flight, self.rng
        stamps = np.arange(0.0, flight.seconds, 1 / flight.fps)
        stamps = np.round(stamps * 1e6) / 1e6
        capture = stamps - flight.biases[Bias.TIME_OFFSET]
        mount_bias = Rotation.from_rotvec(flight.biases[[Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z]])
        true_mount = mount_bias.inv() * BODY_FROM_CAMERA
        camera, ypr = path(flight, capture)
        camera_from_ned = (Rotation.from_euler("ZYX", ypr) * true_mount).inv()
        seen = []
        for target, velocity, label in zip(flight.targets, flight.velocities, flight.labels, strict=True):
            where = np.stack([target[0] + velocity[0] * capture, target[1] + velocity[1] * capture, 0 * capture], -1)
            d = camera_from_ned.apply(where - camera)
            uv = pixel_from_camera(d)
            inside = (np.abs(uv[:, 0] - 319.5) < 320) & (np.abs(uv[:, 1] - 239.5) < 240) & (d[:, 2] > 0)
            inside &= rng.random(len(uv)) >= flight.miss
            uv = uv + rng.standard_normal(uv.shape) * flight.pixel_px
            wrong = rng.random(len(uv)) < flight.gross
            uv[wrong] = rng.uniform([0, 0], [639, 479], (int(wrong.sum()), 2))
            seen += [(k, uv[k], label) for k in np.nonzero(inside)[0]]
        for k in np.nonzero(rng.random(len(stamps)) < flight.clutter)[0]:
            seen.append((k, rng.uniform([0, 0], [639, 479]), flight.labels[0]))
        return self._views(stamps, seen)

    def _views(self, stamps, seen):
        by_frame = [[] for _ in stamps]
        if seen:
            index = np.array([k for k, _, _ in seen])
            fixes = self._fixes(stamps, index, np.array([uv for _, uv, _ in seen]), [label for _, _, label in seen])
            for k, fix in zip(index, fixes, strict=True):
                if fix is not None:
                    by_frame[k].append(fix)
        rotation, position, _, _ = self.told(stamps)
        return [
            FrameView(
                frame=k, host_ns=_ns(EPOCH_NS, t), boot_ns=_ns(BOOT_NS, t), fixes=tuple(by_frame[k]),
                could_see=_viewer(rotation[k], position[k]),
            )
            for k, t in enumerate(stamps)
        ]  # fmt: skip

    def _fixes(self, stamps, index, uv, labels):
        told = self.told(stamps)
        rotation, camera, rates, velocity = told[0][index], told[1][index], told[2][index], told[3][index]
        ray = camera_from_pixel(uv)
        d_du = (camera_from_pixel(uv + RIGHT) - camera_from_pixel(uv - RIGHT)) / 0.02
        d_dv = (camera_from_pixel(uv + BELOW) - camera_from_pixel(uv - BELOW)) / 0.02
        ned_from_camera = rotation * BODY_FROM_CAMERA
        position = on_ground(camera, ned_from_camera.apply(ray))
        jacobian = self._jacobian(rotation, camera, rates, velocity, ray)
        p = self.flight.priors
        sigma = np.full((len(uv), 2), self.flight.pixel_px)
        by_pixel = [(on_ground(camera, ned_from_camera.apply(ray + 1e-4 * d)) - position) / 1e-4 for d in (d_du, d_dv)]
        noise = sum(_outer(j * s[:, None]) for j, s in zip(by_pixel, sigma.T, strict=True))
        by_yaw = self._rotated(rotation, camera, ray, [0, 0, 1e-5])
        for j in (jacobian[:, Bias.ROLL], jacobian[:, Bias.PITCH], by_yaw):
            noise = noise + _outer(j) * p.attitude_noise**2
        noise = noise + _outer(jacobian[:, Bias.HEIGHT]) * p.height_noise_m**2
        late = self.flight.stamp_late_s / np.sqrt(12)
        noise = noise + _outer(jacobian[:, Bias.TIME_OFFSET]) * late**2
        own = np.diag([1.0, 1.0, 0.0])
        sigmas = np.array(p.bias_sigmas)
        relative = noise + sum(_outer(jacobian[:, i]) * sigmas[i] ** 2 for i in range(Bias.POSITION_NORTH))
        wander2 = sigmas[Bias.POSITION_NORTH] ** 2
        noise = noise + own * p.position_noise_m**2
        total = relative + own * (p.position_noise_m**2 + wander2)
        fixes = []
        for k, frame in enumerate(index):
            if ned_from_camera[k].apply(ray[k])[2] < 0.15:
                fixes.append(None)
                continue
            boot, host = _ns(BOOT_NS, stamps[frame]), _ns(EPOCH_NS, stamps[frame])
            state = _state(boot, rotation[k].as_quat(), rates[k], camera[k], velocity[k], *self._stamping)
            sighting = Sighting(
                frame=int(frame), index=0, frame_host_ns=host, host_ns=host,
                detection=Detection(float(uv[k, 0]), float(uv[k, 1]), label=labels[k]),
                ray=Ray(_t(ray[k]), _t(d_du[k]), _t(d_dv[k])), pixel_sigma=_t(sigma[k]), row_fraction=0.0,
                time_noise_s=float(late), state=state, body_from_camera=_m(BODY_FROM_CAMERA.as_matrix()),
                ned_from_camera=_m(ned_from_camera[k].as_matrix()), camera_ned=_t(camera[k]),
                camera_height_above_home_m=float(-camera[k, 2]), relative=False,
            )  # fmt: skip
            fixes.append(
                GroundFix(
                    sighting, _t(position[k]), _m(noise[k]), tuple(_t(j) for j in jacobian[k]), _m(total[k]),
                    _m(relative[k]), ErrorBudget(0, 0, 0, 0, 0, 0, 0, 0), "home",
                )
            )  # fmt: skip
        return fixes

    def _rotated(self, rotation, camera, ray, vector):
        turned = rotation * Rotation.from_rotvec(vector) * BODY_FROM_CAMERA
        base = on_ground(camera, (rotation * BODY_FROM_CAMERA).apply(ray))
        return (on_ground(camera, turned.apply(ray)) - base) / np.linalg.norm(vector)

    def _jacobian(self, rotation, camera, rates, velocity, ray):
        out = np.zeros((len(ray), BIAS_COUNT, 3))
        step = 1e-5
        base = on_ground(camera, (rotation * BODY_FROM_CAMERA).apply(ray))
        for i, vector in ((Bias.ROLL, [step, 0, 0]), (Bias.PITCH, [0, step, 0])):
            out[:, i] = self._rotated(rotation, camera, ray, vector)
        for i, axis in zip((Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z), np.eye(3), strict=True):
            out[:, i] = self._rotated(rotation, camera, ray, step * axis)
        turned = Rotation.from_rotvec([0, 0, step]) * rotation * BODY_FROM_CAMERA
        out[:, Bias.HEADING] = (on_ground(camera, turned.apply(ray)) - base) / step
        later = rotation * Rotation.from_rotvec(rates * step) * BODY_FROM_CAMERA
        out[:, Bias.TIME_OFFSET] = (on_ground(camera + velocity * step, later.apply(ray)) - base) / step
        up = camera - np.array([0, 0, step])
        out[:, Bias.HEIGHT] = (on_ground(up, (rotation * BODY_FROM_CAMERA).apply(ray)) - base) / step
        out[:, Bias.POSITION_NORTH, 0] = 1.0
        out[:, Bias.POSITION_EAST, 1] = 1.0
        return out


def _outer(a):
    return a[:, :, None] * a[:, None, :]


def _viewer(rotation, camera):
    def could_see(place):
        d = (rotation * BODY_FROM_CAMERA).inv().apply(np.asarray(place) - camera)
        uv = pixel_from_camera(d[None])[0]
        return bool(d[2] > 0 and abs(uv[0] - 319.5) < 310 and abs(uv[1] - 239.5) < 230)

    return could_see


def _state(boot_ns, xyzw, rates, position, velocity, spacing_s=0.0, stamp_sigma_s=0.0):
    x, y, z, w = map(float, xyzw)
    return VehicleState(
        boot_ns=int(boot_ns), ned_from_body=(w, x, y, z), rates=_t(rates), attitude_sigma=0.0, gap_s=0.0,
        position_ned=_t(position), velocity_ned=_t(velocity), position_sigma_m=0.0,
        height_above_home_m=float(-position[2]), spacing_s=spacing_s,
        stamp_sigma_s=stamp_sigma_s,
    )  # fmt: skip


def _ns(base, t):
    return int(base + round(t * 1e6) * 1000)


def _t(v):
    return tuple(float(x) for x in v)


def _m(a):
    return tuple(_t(row) for row in a)


LEVEL = np.diag([0.04, 0.04, 0.0])


def a_fix(t, position, noise=LEVEL, jacobian=None, sigmas=None, **detection):
    """One fix at t seconds, made by hand: ``jacobian`` (3, BIAS_COUNT), ``sigmas`` the biases' priors."""
    jacobian = np.zeros((3, BIAS_COUNT)) if jacobian is None else jacobian
    scaled = jacobian * (np.zeros(BIAS_COUNT) if sigmas is None else np.array(sigmas))
    shares = [np.outer(j, j) for j in scaled.T]
    relative = noise + sum(shares[: Bias.POSITION_NORTH])
    total = relative + shares[Bias.POSITION_NORTH] + shares[Bias.POSITION_EAST]
    boot, host = _ns(BOOT_NS, t), _ns(EPOCH_NS, t)
    camera = np.array([0.0, 0.0, -10.0])
    identity = Rotation.identity()
    sighting = Sighting(
        frame=round(t * 1000), index=0, frame_host_ns=host, host_ns=host,
        detection=Detection(320.0, 240.0, **detection), ray=Ray((0, 0, 1.0), (0.0015, 0, 0), (0, 0.0015, 0)),
        pixel_sigma=(4.0, 4.0), row_fraction=0.0, time_noise_s=0.0,
        state=_state(boot, identity.as_quat(), np.zeros(3), camera, np.zeros(3)),
        body_from_camera=_m(np.eye(3)), ned_from_camera=_m(np.eye(3)), camera_ned=_t(camera),
        camera_height_above_home_m=10.0, relative=False,
    )  # fmt: skip
    budget = ErrorBudget(0, 0, 0, 0, 0, 0, 0, 0)
    return GroundFix(
        sighting, _t(position), _m(noise), tuple(_t(j) for j in jacobian.T), _m(total), _m(relative), budget, "home"
    )


def a_view(t, *fixes, sees=True):
    """One frame at t seconds."""
    return FrameView(
        frame=round(t * 1000), host_ns=_ns(EPOCH_NS, t), boot_ns=_ns(BOOT_NS, t), fixes=fixes, could_see=lambda _: sees
    )


def host_ns(t):
    """The host instant at t seconds."""
    return _ns(EPOCH_NS, t)
