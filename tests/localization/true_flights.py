"""One sighting of a known target by a vehicle with chosen errors: the truth first, then what the autopilot reports.

numpy and scipy only, independent of the package's geometry. The lens projects; it has oracles of its own.
"""

from dataclasses import dataclass, field
from math import radians

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fwav_companion.camera import KannalaBrandt
from fwav_companion.localization import HomeGround, Localizer
from fwav_companion.types import Bias, Detection, ErrorPriors, GimbalAt, RangeSample, Sighting, VehicleState

LENS = KannalaBrandt((1.0, 0.02, -0.003), (200.0, 201.0), (400.0, 398.0), (800, 800))
DOWNWARD_CAMERA = Rotation.from_matrix([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
"""Image top to the nose: camera x is body y, camera y is minus body x."""

PRIORS = ErrorPriors(
    pixel_noise_px=4.0,
    attitude_noise=radians(0.1),
    position_noise_m=0.1,
    height_noise_m=0.3,
    bias_sigmas=(
        radians(0.5),
        radians(0.5),
        radians(2),
        *(radians(1),) * 3,
        0.01,
        0.008,
        0.5,
        1.0,
        1.0,
        4.0,
        0.05,
        *(0.03,) * 3,
        1.0,
    ),
    position_bias_time_s=60.0,
)
LEVEL_PRIORS = msgspec.structs.replace(
    PRIORS,
    bias_sigmas=tuple(
        0.0 if bias is Bias.TERRAIN else sigma for bias, sigma in zip(Bias, PRIORS.bias_sigmas, strict=True)
    ),
)
"""The same over ground that is level."""
STEPS = np.array([1e-5] * 8 + [1e-3] * 4 + [1e-5] + [1e-3] * 4)
"""Steps of the differences, by Bias: radians, seconds, metres."""


def tuples(matrix):
    return tuple(tuple(float(x) for x in row) for row in matrix)


def quaternion(rotation: Rotation):
    """(w, x, y, z)."""
    x, y, z, w = rotation.as_quat().tolist()
    return (w, x, y, z)


@dataclass
class Noise:
    """Independent errors of one sample."""

    pixel: np.ndarray = field(default_factory=lambda: np.zeros(2))
    attitude: np.ndarray = field(default_factory=lambda: np.zeros(3))  # roll, pitch, heading
    bridging: np.ndarray = field(default_factory=lambda: np.zeros(3))  # about the body's axes
    place: np.ndarray = field(default_factory=lambda: np.zeros(2))
    height: float = 0.0
    time_s: float = 0.0


@dataclass
class Scene:
    """A vehicle, a target on level ground, and how well the autopilot knows it."""

    roll_deg: float = 8.0
    pitch_deg: float = 37.0
    yaw_deg: float = 60.0
    height_m: float = 40.0
    target: tuple[float, float] = (12.0, 25.0)  # north, east of the vehicle, metres
    velocity: tuple[float, float, float] = (6.0, 4.0, -0.5)
    rates: tuple[float, float, float] = (0.4, 0.9, -0.2)
    row_fraction: float = 0.6
    relative: bool = False
    pixel_sigma: tuple[float, float] = (3.0, 5.0)
    bridging_sigma: float = 0.002
    time_noise_s: float = 0.002
    position_sigma_m: float = 0.05
    vehicle: tuple[float, float] = (100.0, -50.0)
    beam: tuple[float, float, float] | None = None
    on_gimbal: bool = False
    """Whether a gimbal with the attitude of the body carries the camera; attitude errors are then the gimbal's."""
    rises: tuple[float, float] = (0.0, 0.0)
    """Assumed height of the detected point above the target on the ground, and one sigma of it, metres."""

    def truth(self) -> np.ndarray:
        """The target in the world of the answer."""
        north, east = np.array(self.target) + (0.0 if self.relative else np.array(self.vehicle))
        return np.array([north, east, 0.0])

    def sighting(self, bias=None, noise: Noise | None = None) -> Sighting:
        """What reaches the localizer when the biases (by Bias) and the noise are these."""
        bias = np.zeros(len(Bias)) if bias is None else np.asarray(bias, dtype=float)
        noise = noise or Noise()
        mount = Rotation.from_rotvec(bias[3:6]) * DOWNWARD_CAMERA
        at_capture = self._attitude(0.0)
        rises_m = self.rises[0] - bias[Bias.TARGET_HEIGHT] * self.rises[1]
        offset = np.array([*self.target, self.height_m - rises_m])
        u, v = LENS.pixel_from_camera_point(tuple((at_capture * mount).inv().apply(offset)))
        u, v = float(u + noise.pixel[0]), float(v + noise.pixel[1])

        late = bias[Bias.TIME_OFFSET] + self.row_fraction * bias[Bias.READOUT] + noise.time_s
        roll, pitch, heading = bias[:3] + noise.attitude
        reported = (
            Rotation.from_rotvec([0.0, 0.0, heading])
            * self._attitude(late)
            * Rotation.from_rotvec(np.array([roll, pitch, 0.0]) + noise.bridging)
        )
        place = np.array([*self.vehicle, -self.height_m]) + late * np.array(self.velocity)
        place[:2] += bias[[Bias.POSITION_NORTH, Bias.POSITION_EAST]] + noise.place
        place[2] -= bias[Bias.HEIGHT] + noise.height
        place -= bias[Bias.POSITION_DELAY] * np.array(self.velocity)
        body = self._attitude(late) if self.on_gimbal else reported
        place += body.apply(bias[Bias.LEVER_X : Bias.TARGET_HEIGHT])
        state = VehicleState(
            boot_ns=0,
            ned_from_body=quaternion(body),
            rates=self.rates,
            attitude_sigma=self.bridging_sigma,
            gap_s=0.004,
            position_ned=None if self.relative else tuple(place.tolist()),
            velocity_ned=self.velocity,
            position_sigma_m=self.position_sigma_m,
            height_above_home_m=-float(place[2]),
            range=self._reading(late),
            gimbal=GimbalAt(quaternion(reported), self.rates, self.bridging_sigma, 0.004) if self.on_gimbal else None,
        )
        return Sighting(
            frame=1,
            index=0,
            frame_host_ns=0,
            host_ns=0,
            detection=Detection(u, v),
            ray=LENS.camera_ray_and_derivatives_from_pixel(u, v),
            pixel_sigma=self.pixel_sigma,
            row_fraction=self.row_fraction,
            time_noise_s=self.time_noise_s,
            state=state,
            body_from_camera=tuples(DOWNWARD_CAMERA.as_matrix()),
            ned_from_camera=tuples((reported * DOWNWARD_CAMERA).as_matrix()),
            camera_ned=(0.0, 0.0, 0.0) if self.relative else tuple(place.tolist()),
            camera_height_above_home_m=-float(place[2]),
            relative=self.relative,
            anchor_height_m=self.rises[0],
            anchor_sigma_m=self.rises[1],
        )

    def draw(self, rng: np.random.Generator, priors: ErrorPriors = PRIORS) -> tuple[np.ndarray, Noise]:
        """Biases and noise drawn from the configured priors."""
        bias = np.zeros(len(Bias))
        bias[: Bias.TARGET_HEIGHT] = rng.normal(size=int(Bias.TARGET_HEIGHT)) * priors.bias_sigmas[: Bias.TARGET_HEIGHT]
        if self.rises[1] > 0.0:
            bias[Bias.TARGET_HEIGHT] = rng.normal() * priors.sigma(Bias.TARGET_HEIGHT)
        age = self.position_sigma_m
        return bias, Noise(
            rng.normal(size=2) * self.pixel_sigma,
            rng.normal(size=3) * priors.attitude_noise,
            rng.normal(size=3) * self.bridging_sigma,
            rng.normal(size=2) * np.hypot(priors.position_noise_m, age),
            rng.normal() * np.hypot(priors.height_noise_m, age),
            rng.normal() * self.time_noise_s,
        )

    def _attitude(self, at_s: float) -> Rotation:
        q = Rotation.from_euler("ZYX", [self.yaw_deg, self.pitch_deg, self.roll_deg], degrees=True)
        return q * Rotation.from_rotvec(at_s * np.array(self.rates))

    def _reading(self, at_s: float) -> RangeSample | None:
        """The rangefinder reading at the true instant along the true beam, stamped with the assumed time of the
        capture.
        """
        if self.beam is None:
            return None
        down = self._attitude(0.0).apply(self.beam)[2]
        return RangeSample(0, self.height_m / down, self.beam, 0.0)


SCENES = {
    "ahead and turned": Scene(),
    "below": Scene(roll_deg=-3.0, pitch_deg=5.0, target=(1.0, -2.0)),
    "relative": Scene(relative=True),
    "rolled": Scene(roll_deg=-25.0, pitch_deg=15.0, target=(-10.0, 30.0), row_fraction=0.1),
    "low": Scene(height_m=3.0, target=(1.0, 1.5), velocity=(1.0, 0.0, 0.3)),
    "standing": Scene(height_m=8.0, target=(4.0, 6.0), rises=(0.85, 0.085)),
    "standing, relative": Scene(height_m=8.0, target=(4.0, 6.0), rises=(1.7, 0.17), relative=True),
}
every_scene = pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES.keys())


def home() -> Localizer:
    return Localizer(HomeGround(), LEVEL_PRIORS, min_height_m=0.5)


def scaled_priors(factor: float):
    p = LEVEL_PRIORS
    return msgspec.structs.replace(
        p,
        attitude_noise=factor * p.attitude_noise,
        position_noise_m=factor * p.position_noise_m,
        height_noise_m=factor * p.height_noise_m,
        bias_sigmas=tuple(factor * s for s in p.bias_sigmas),
    )
