"""A small world for the tracker: detections of a camera in flight, and fixes computed from the autopilot's reports.

Independent of the package's localization: rays are intersected with flat ground, Jacobians are finite differences. The
truth is chosen first; the tracker's input follows from it.
"""

from __future__ import annotations

import numpy as np
from handmade import KnownErrors, a_state, boot_ns, host_ns, matrix, vector
from scipy.spatial.transform import Rotation
from simulated_autopilot import Autopilot
from simulated_flight import BODY_FROM_CAMERA, Flight, camera_from_pixel, path, pixel_from_camera

from fwav_companion.types import BIAS_COUNT, Bias, Detection, FrameView, GroundFix, Ray, Sighting

MOUNT = [Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z]
RIGHT, BELOW = np.array([0.01, 0]), np.array([0, 0.01])
STEP = 1e-5
"""Step of the differences: pixels, radians, seconds, metres."""
FLATTEST = 0.15
"""Smallest down component of a unit ray: a flatter ray meets the ground too far away for a fix."""


class World:
    """One flight, reported and seen: frames for the tracker, and a history of states."""

    def __init__(self, flight: Flight) -> None:
        self.flight = flight
        self.rng = np.random.default_rng(flight.seed)
        self.autopilot = Autopilot(flight, self.rng)

    def state_at(self, stamp_ns):
        """The vehicle's state, in the form of telemetry."""
        return self.autopilot.state_at(stamp_ns)

    def frames(self) -> list[FrameView]:
        """All frames of the camera, localized as configured."""
        stamps = np.arange(0.0, self.flight.seconds, 1 / self.flight.fps)
        stamps = np.round(stamps * 1e6) / 1e6
        seen = self._seen(stamps - self.flight.biases[Bias.TIME_OFFSET])
        reported = self.autopilot.reported(stamps)
        by_frame = [[] for _ in stamps]
        for k, fix in self._fixes(stamps, reported, seen) if seen else ():
            by_frame[k].append(fix)
        rotation, position, *_ = reported
        return [
            FrameView(
                frame=k, host_ns=host_ns(t), boot_ns=boot_ns(t), fixes=tuple(by_frame[k]),
                could_see=_viewer(rotation[k], position[k]),
            )
            for k, t in enumerate(stamps)
        ]  # fmt: skip

    def _seen(self, capture):
        """(index of the frame, pixel, label) of every detection, target by target and then the clutter."""
        flight, rng = self.flight, self.rng
        true_mount = Rotation.from_rotvec(flight.biases[MOUNT]).inv() * BODY_FROM_CAMERA
        camera, ypr = path(flight, capture)
        camera_from_ned = (Rotation.from_euler("ZYX", ypr) * true_mount).inv()
        seen = []
        for target, velocity, label in zip(flight.targets, flight.velocities, flight.labels, strict=True):
            where = self._places(target, velocity, capture)
            d = camera_from_ned.apply(where - camera)
            uv = pixel_from_camera(d)
            inside = (np.abs(uv[:, 0] - 319.5) < 320) & (np.abs(uv[:, 1] - 239.5) < 240) & (d[:, 2] > 0)
            inside &= rng.random(len(uv)) >= flight.miss
            uv = uv + rng.standard_normal(uv.shape) * flight.pixel_px
            wrong = rng.random(len(uv)) < flight.gross
            uv[wrong] = rng.uniform([0, 0], [639, 479], (int(wrong.sum()), 2))
            seen += [(k, uv[k], label) for k in np.nonzero(inside)[0]]
        always, sometimes = divmod(flight.clutter, 1.0)
        false = np.append(
            np.nonzero(rng.random(len(capture)) < sometimes)[0], np.repeat(range(len(capture)), int(always))
        )
        for k in false:
            seen.append((k, rng.uniform([0, 0], [639, 479]), flight.labels[0]))
        return seen

    def _places(self, target, velocity, capture):
        """(N, 3) true places of a target."""
        return np.stack([target[0] + velocity[0] * capture, target[1] + velocity[1] * capture, 0 * capture], -1)

    def _fixes(self, stamps, reported, seen):
        """(index of the frame, fix) of every detection whose ray goes down to the ground."""
        index, uv = np.array([k for k, _, _ in seen]), np.array([uv for _, uv, _ in seen])
        cast = _Cast([one[index] for one in reported], uv)
        jacobian = cast.by_bias()
        noise, total, relative = self._covariances(cast, jacobian)
        for n, (k, _, label) in enumerate(seen):
            if cast.ned_from_camera[n].apply(cast.ray[n])[2] < FLATTEST:
                continue
            columns = tuple(vector(j) for j in jacobian[n])
            yield k, GroundFix(
                self._sighting(cast, n, k, stamps[k], label), vector(cast.position[n]), matrix(noise[n]), columns,
                KnownErrors(matrix(total[n]), matrix(relative[n])), "home",
            )  # fmt: skip

    def _covariances(self, cast, jacobian):
        """(N, 3, 3) each: covariance of the noise, of all errors, and of all except the vehicle's position."""
        p, sigmas = self.flight.priors, np.array(self.flight.priors.bias_sigmas)
        noise = sum(_outer(cast.by_pixel(d) * self.flight.pixel_px) for d in (cast.d_du, cast.d_dv))
        for j in (jacobian[:, Bias.ROLL], jacobian[:, Bias.PITCH], cast.by_turn([0, 0, STEP])):
            noise = noise + _outer(j) * p.attitude_noise**2
        noise = noise + _outer(jacobian[:, Bias.HEIGHT]) * p.height_noise_m**2
        noise = noise + _outer(jacobian[:, Bias.TIME_OFFSET]) * self._late_s**2
        own = np.diag([1.0, 1.0, 0.0])
        relative = noise + sum(_outer(jacobian[:, i]) * sigmas[i] ** 2 for i in range(Bias.POSITION_NORTH))
        noise = noise + own * p.position_noise_m**2
        total = relative + own * (p.position_noise_m**2 + sigmas[Bias.POSITION_NORTH] ** 2)
        return noise, total, relative

    def _sighting(self, cast, n, k, t, label):
        u, v = cast.uv[n]
        camera = cast.camera[n]
        state = a_state(
            boot_ns(t),
            cast.rotation[n].as_quat(),
            cast.rates[n],
            camera,
            cast.velocity[n],
            *self.autopilot.stamping,
            acceleration=cast.acceleration[n],
            frequency=self.autopilot.frequency,
        )
        return Sighting(
            frame=int(k), index=0, frame_host_ns=host_ns(t), host_ns=host_ns(t),
            detection=Detection(float(u), float(v), label=label),
            ray=Ray(vector(cast.ray[n]), vector(cast.d_du[n]), vector(cast.d_dv[n])),
            pixel_sigma=(float(self.flight.pixel_px),) * 2, row_fraction=0.0, time_noise_s=float(self._late_s),
            state=state, body_from_camera=matrix(BODY_FROM_CAMERA.as_matrix()),
            ned_from_camera=matrix(cast.ned_from_camera[n].as_matrix()), camera_ned=vector(camera),
            camera_height_above_home_m=float(-camera[2]), relative=False,
        )  # fmt: skip

    @property
    def _late_s(self):
        """One sigma of the lateness of stamps, uniform between none and the most, s."""
        return self.flight.stamp_late_s / np.sqrt(12)


class _Cast:
    """N pixels projected to the ground from the reported camera poses, with their derivatives by differences."""

    def __init__(self, reported, uv) -> None:
        """``reported``: N rotations, positions, rates, velocities and angular accelerations."""
        self.rotation, self.camera, self.rates, self.velocity, self.acceleration = reported
        self.uv, self.ray = uv, camera_from_pixel(uv)
        self.d_du = (camera_from_pixel(uv + RIGHT) - camera_from_pixel(uv - RIGHT)) / 0.02
        self.d_dv = (camera_from_pixel(uv + BELOW) - camera_from_pixel(uv - BELOW)) / 0.02
        self.ned_from_camera = self.rotation * BODY_FROM_CAMERA
        self.position = self._met(self.rotation, self.camera)

    def by_pixel(self, d):
        """Derivative by a move of the ray, ``d`` a pixel."""
        return (_on_ground(self.camera, self.ned_from_camera.apply(self.ray + 1e-4 * d)) - self.position) / 1e-4

    def by_turn(self, turn):
        """Derivative by a rotation of the camera, a rotation vector in body axes."""
        turned = self._met(self.rotation * Rotation.from_rotvec(turn), self.camera)
        return (turned - self.position) / np.linalg.norm(turn)

    def by_bias(self):
        """(N, BIAS_COUNT, 3) derivatives by each bias."""
        out = np.zeros((len(self.ray), BIAS_COUNT, 3))
        for i, turn in ((Bias.ROLL, [STEP, 0, 0]), (Bias.PITCH, [0, STEP, 0])):
            out[:, i] = self.by_turn(turn)
        for i, axis in zip(MOUNT, np.eye(3), strict=True):
            out[:, i] = -self.by_turn(STEP * axis)  # the package's bias turns the true mount, not the configured one
        headed = Rotation.from_rotvec([0, 0, STEP]) * self.rotation
        out[:, Bias.HEADING] = self._moved(headed, self.camera)
        later = self.rotation * Rotation.from_rotvec(self.rates * STEP)
        out[:, Bias.TIME_OFFSET] = self._moved(later, self.camera + self.velocity * STEP)
        out[:, Bias.HEIGHT] = self._moved(self.rotation, self.camera - np.array([0, 0, STEP]))
        out[:, Bias.POSITION_NORTH, 0] = 1.0
        out[:, Bias.POSITION_EAST, 1] = 1.0
        return out

    def _moved(self, rotation, camera):
        return (self._met(rotation, camera) - self.position) / STEP

    def _met(self, rotation, camera):
        return _on_ground(camera, (rotation * BODY_FROM_CAMERA).apply(self.ray))


def _on_ground(camera, ray):
    """Where rays NED meet down = 0."""
    return camera - ray * (camera[:, 2:3] / ray[:, 2:3])


def _outer(a):
    return a[:, :, None] * a[:, None, :]


def _viewer(rotation, camera):
    def could_see(place):
        d = (rotation * BODY_FROM_CAMERA).inv().apply(np.asarray(place) - camera)
        uv = pixel_from_camera(d[None])[0]
        return bool(d[2] > 0 and abs(uv[0] - 319.5) < 310 and abs(uv[1] - 239.5) < 230)

    return could_see
