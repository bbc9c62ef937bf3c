"""A vehicle that is shaken over a tag, with known truth: by numpy and scipy, with the fisheye's formula written out."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import cos, floor, sin
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from fwav_companion.camera import parse_calibration
from fwav_companion.geometry.stamps import BootNs
from fwav_companion.tools.shake.estimate import ShakeData, ShakeEstimate, estimate
from fwav_companion.tools.shake.observations import TagObservation
from fwav_companion.types import AttitudeSample

LENS = parse_calibration(
    "model: kannala_brandt\nimage_size: [640, 480]\nk_mm: [3.55, 0.03, 0.0, 0.0, 0.0]\n"
    "pixels_per_mm: [188.0, 188.0]\nprincipal_point: [320.0, 240.0]\n",
    "camera.yaml",
).lens
BELLY = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""body_from_camera of a camera that looks down, image top to the nose."""
FORWARD_DOWN = Rotation.from_euler("y", -40.0, degrees=True).as_matrix() @ np.array(
    [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
)
"""body_from_camera of a camera that looks 40 degrees below the nose."""
BOOT_S = 100.0
ATTITUDE_HZ = 100.0


@dataclass(frozen=True)
class Hands:
    """The planted errors and the motion; angles in degrees."""

    seed: int = 0
    delay_s: float = 0.035
    mount_deg: tuple[float, float, float] = (0.5, 1.0, 2.0)
    configured: Any = field(default_factory=lambda: BELLY)
    image: Any = field(default_factory=lambda: np.eye(2))
    """Transformation of the picture about its middle: rotation, mirror image."""
    reported_signs: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Signs of roll, pitch and yaw as the autopilot reports them."""
    swing_deg: tuple[float, float, float] = (11.0, 11.0, 4.0)
    flap_deg: float = 2.0
    rhythm_hz: float | None = None
    """Frequency of a rhythmic swing about roll alone, Hz; None: swings about all axes without a common rhythm."""
    turn_deg: float = 90.0
    seconds: float = 20.0
    height_m: float = 0.9
    tilt_deg: float = 0.0
    """Mean pitch of the motion."""
    tag_m: float = 0.16
    slope_deg: tuple[float, float] = (0.0, 0.0)
    corner_px: float = 0.15
    attitude_deg: float = 0.1
    readout_s: float = 0.0
    assumed_readout: tuple[float, float] = (0.0, 0.0)
    """Readout time that the estimate assumes, and its sigma, seconds."""
    spoiled: float = 0.0
    """Share of frames with one corner displaced."""
    reorder: tuple[int, ...] = (0, 1, 2, 3)
    """Order in which the detector reports the corners."""

    def but(self, **what: Any) -> Hands:
        return replace(self, **what)

    # The truth.

    def angles(self, t: Any) -> Any:
        """(..., 3) roll, pitch, yaw in radians."""
        rng = np.random.default_rng(self.seed)
        t = np.asarray(t)
        angles = []
        for swing_deg in self.swing_deg:
            hz, phases = rng.uniform(0.5, 1.7, 3), rng.uniform(0.0, 6.28, 3)
            sizes = np.radians(swing_deg) * np.array([1.0, 0.7, 0.5]) / 1.32
            if self.rhythm_hz is not None:
                hz, phases, sizes = np.full(3, self.rhythm_hz), np.full(3, phases[0]), sizes * [1.3, 0.0, 0.0]
            angles.append((sizes * np.sin(2 * np.pi * np.multiply.outer(t, hz) + phases)).sum(-1))
        angles[1] = angles[1] + np.radians(self.flap_deg) * np.sin(2 * np.pi * 5.0 * t) + np.radians(self.tilt_deg)
        x = np.clip((t - self.seconds / 2 + 0.8) / 1.6, 0.0, 1.0)
        angles[2] = angles[2] + rng.uniform(-3, 3) + np.radians(self.turn_deg) * (3 * x**2 - 2 * x**3)
        return np.stack(angles, axis=-1)

    def ned_from_body(self, t: Any) -> Any:
        angles = self.angles(t)
        turned = Rotation.from_euler("ZYX", angles.reshape(-1, 3)[:, ::-1]).as_matrix()
        return turned.reshape(*angles.shape[:-1], 3, 3)

    def place(self, t: Any) -> Any:
        """Camera position relative to the tag's middle, NED; the camera is aimed at the tag."""
        rng = np.random.default_rng(self.seed + 7)
        hz, phases = rng.uniform(0.2, 0.8, 3), rng.uniform(0.0, 6.28, 3)
        drift = 0.04 * np.sin(2 * np.pi * np.multiply.outer(np.asarray(t), hz) + phases)
        yaw = self.angles(t)[..., 2]
        level = Rotation.from_euler("ZY", np.stack([yaw, np.radians(self.tilt_deg) + 0.0 * yaw], -1).reshape(-1, 2))
        looks = level.apply(self.body_from_camera[:, 2]).reshape(*yaw.shape, 3)
        return drift - self.height_m * looks / looks[..., 2:]

    @property
    def body_from_camera(self) -> Any:
        return Rotation.from_rotvec(np.radians(self.mount_deg)).as_matrix() @ self.configured

    # Detections and reports.

    def shaking(self, **what: Any) -> ShakeData:
        rng = np.random.default_rng(self.seed + 1)
        readout_s, readout_sigma_s = self.assumed_readout
        given = {
            "tags": self._views(rng),
            "attitude_at": self._attitude_at(rng),
            "samples": self.samples(),
            "lens": LENS,
            "body_from_camera": tuple(map(tuple, self.configured.tolist())),
            "tag_size_m": self.tag_m,
            "readout_s": readout_s,
            "readout_sigma_s": readout_sigma_s,
            "attitude_noise": np.radians(self.attitude_deg),
            "clock_sigma_s": 0.0,
            "stamp_sigma_s": 0.0,
        }
        return ShakeData(**given | what)

    def found(self, **what: Any) -> ShakeEstimate:
        return estimate(self.shaking(**what))

    def samples(
        self, lag_s: float = 0.011, signs: tuple[float, float, float] = (1.0, 1.0, 1.0)
    ) -> list[AttitudeSample]:
        """Attitudes with rates that are late by a pure delay."""
        rng = np.random.default_rng(self.seed + 2)
        t = np.arange(0.0, self.seconds, 1.0 / ATTITUDE_HZ) + rng.uniform(0.0, 0.002, int(self.seconds * ATTITUDE_HZ))
        noise = Rotation.from_rotvec(np.radians(self.attitude_deg) * rng.normal(size=(len(t), 3))).as_matrix()
        q = Rotation.from_matrix(self.ned_from_body(t) @ noise).as_quat()
        near = 1e-3
        before, after = self.ned_from_body(t - lag_s - near), self.ned_from_body(t - lag_s + near)
        rates = Rotation.from_matrix(np.swapaxes(before, -1, -2) @ after).as_rotvec() / (2 * near) * signs
        return [
            AttitudeSample(BootNs(round((BOOT_S + at) * 1e9)), (w, x, y, z), tuple(rate))
            for at, (x, y, z, w), rate in zip(t.tolist(), q.tolist(), rates.tolist(), strict=True)
        ]

    def _views(self, rng: Any) -> list[TagObservation]:
        stamps = np.arange(0.0, self.seconds, 1.0 / 30.0) + rng.uniform(0.0, 0.003)
        tag = Rotation.from_rotvec(np.radians([*self.slope_deg, 0.0])) * Rotation.from_euler("z", rng.uniform(-3, 3))
        corners = tag.apply(self.tag_m / 2 * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]))
        rows = np.full((len(stamps), 4), 240.0)
        for _ in range(6 if self.readout_s else 1):
            t = stamps[:, None] + self.readout_s * rows / 480.0
            camera_from_ned = self.body_from_camera.T @ np.swapaxes(self.ned_from_body(t), -1, -2)
            pixels = fisheye((camera_from_ned @ (corners - self.place(t))[..., None])[..., 0])
            rows = pixels[..., 1]
        middle = np.array([320.0, 240.0])
        pixels = (pixels - middle) @ np.asarray(self.image).T + middle
        pixels += self.corner_px * rng.normal(size=pixels.shape)
        spoiled = rng.random(len(stamps)) < self.spoiled
        pixels[spoiled, 1] += rng.uniform(-40, 40, (spoiled.sum(), 2))
        pixels = pixels[:, list(self.reorder)]
        return [
            TagObservation(BootNs(round((BOOT_S + stamp + self.delay_s) * 1e9)), tuple(map(tuple, four)))
            for stamp, four in zip(stamps.tolist(), pixels.tolist(), strict=True)
        ]

    def _attitude_at(self, rng: Any) -> Any:
        """The true attitude with noise that is drawn a hundred times a second and interpolated linearly."""
        noise = np.radians(self.attitude_deg) * rng.normal(size=(int((self.seconds + 4.0) * ATTITUDE_HZ), 3))
        step = 1.0 / ATTITUDE_HZ
        times = np.arange(-1.0, self.seconds + 1.0, 0.0025)
        course = (self.angles(times) * np.array(self.reported_signs)).tolist()
        drawn = noise.tolist()  # scalars: an estimate asks for twenty thousand attitudes, one at a time

        def attitude_at(boot_ns: BootNs) -> tuple[float, float, float, float] | None:
            t = boot_ns * 1e-9 - BOOT_S
            if not -0.9 < t < self.seconds + 0.9:
                return None
            index, share = divmod((t + 1.0) / step, 1.0)
            whole = floor((t + 1.0) / 0.0025)
            part = (t + 1.0) / 0.0025 - whole
            angles = (
                a
                + part * (b - a)
                + (a - before - after + b) * 0.25 * part * (1.0 - part)
                + (x * (1.0 - share) + y * share)
                for before, a, b, after, x, y in zip(
                    *course[whole - 1 : whole + 3], *drawn[int(index) : int(index) + 2], strict=True
                )
            )
            return _quaternion(*angles)

        return attitude_at


def fisheye(points: Any) -> Any:
    """(..., 2) pixels of (..., 3) points, by the paper's formula."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    across = np.hypot(x, y)
    theta = np.arctan2(across, z)
    r = 3.55 * theta + 0.03 * theta**3
    return np.stack([320.0 + 188.0 * r * x / across, 240.0 + 188.0 * r * y / across], axis=-1)


def _quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Yaw after pitch after roll, each by its half angle."""
    a, b, c = roll / 2, pitch / 2, yaw / 2
    w = cos(a) * cos(b) * cos(c) + sin(a) * sin(b) * sin(c)
    x = sin(a) * cos(b) * cos(c) - cos(a) * sin(b) * sin(c)
    y = cos(a) * sin(b) * cos(c) + sin(a) * cos(b) * sin(c)
    z = cos(a) * cos(b) * sin(c) - sin(a) * sin(b) * cos(c)
    return w, x, y, z


def correction_deg(shaken: ShakeEstimate) -> Any:
    """Estimated correction of the mount about the body's axes, degrees."""
    return np.degrees([known.value for known in shaken.mount])
