"""Pads as a camera sees them, by the mock's own lens and rotations, as sightings of their tags."""

from __future__ import annotations

from math import radians

import numpy as np
from handmade import a_sighting, a_state, boot_ns, host_ns, matrix
from scipy.spatial.transform import Rotation

from fwav_companion.camera.kannala_brandt import KannalaBrandt
from fwav_companion.types import Detection, Pad, PadTag
from sitl_mock.lens import Lens as MockLens
from sitl_mock.options import CameraOptions
from sitl_mock.rotation import FORWARD_CAMERA, matrix_from_euler, times

OPTIONS = CameraOptions()
MOCK = MockLens(OPTIONS)
LENS = KannalaBrandt(OPTIONS.k_mm, OPTIONS.pixels_per_mm, OPTIONS.principal_point, OPTIONS.image_size)
STATE = a_state(boot_ns(1.0), Rotation.identity().as_quat(), np.zeros(3), np.zeros(3), np.zeros(3))

THREE = Pad(
    label="pad",
    tags=(
        PadTag(label="tag36h11:0", size_m=0.4),
        PadTag(label="tag36h11:1", size_m=0.15, at_m=(0.35, 0.1), yaw_deg=90.0),
        PadTag(label="tag36h11:2", size_m=0.06, at_m=(-0.3, -0.1), yaw_deg=-30.0),
    ),
)


class Scene:
    """A camera over a pad. Tilts of the pad turn about its forward and right axes."""

    def __init__(self, pad, *, camera=(0.3, -0.2, -3.0), euler=(2.0, -3.0, 25.0), heading=70.0, tilt=(0.0, 0.0)):
        self.pad, self.camera = pad, np.array(camera)
        look_down = times(matrix_from_euler(0.0, radians(-90.0), 0.0), FORWARD_CAMERA)
        self.ned_from_camera = np.array(times(matrix_from_euler(*map(radians, euler)), look_down))
        self.ned_from_pad = np.array(matrix_from_euler(radians(tilt[0]), radians(tilt[1]), radians(heading)))

    def place(self, forward, right):
        """Place of a point of the pad minus the camera, NED."""
        return self.ned_from_pad @ np.array([forward, right, 0.0]) - self.camera

    def pixel(self, forward, right):
        """Pixel of a point of the pad."""
        return MOCK.pixel(tuple(self.ned_from_camera.T @ self.place(forward, right)))

    def corners(self, tag):
        """Pixels of a tag's corners, from the upper left one of the print, clockwise."""
        turn, half = radians(tag.yaw_deg), 0.5 * tag.size_m
        up, aside = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
        return [
            self.pixel(*(np.array(tag.at_m) + half * (a * up + b * aside)))
            for a, b in ((1, -1), (1, 1), (-1, 1), (-1, -1))
        ]

    def sighting(self, number, *, index=0, sigma=0.1, noise=None, order=(0, 1, 2, 3), at=1.0, corners=True, tag=None):
        """Sighting of one of the pad's tags. ``noise``: draws of the corners' errors; ``tag``: what is really there."""
        real = tag or self.pad.tags[number]
        pixels = np.array(self.corners(real))
        if noise is not None:
            pixels = pixels + noise.normal(0.0, 2.0 * sigma, pixels.shape)
        u, v = map(float, self.pixel(*real.at_m))
        detection = Detection(
            u=u, v=v, sigma=(sigma, sigma), label=self.pad.tags[number].label,
            corners=tuple(tuple(map(float, pixels[k])) for k in order) if corners else None,
        )  # fmt: skip
        ray = LENS.camera_ray_and_derivatives_from_pixel(u, v)
        sighting = a_sighting(
            host_ns(at), STATE, detection=detection, ray=ray, pixel_sigma=sigma, axes=matrix(self.ned_from_camera),
            camera_ned=tuple(map(float, self.camera)),
        )  # fmt: skip
        return type(sighting)(
            **{name: getattr(sighting, name) for name in sighting.__struct_fields__} | {"index": index}
        )

    def sightings(self, numbers=None, **kinds):
        """Sightings of these tags, by default of all."""
        numbers = range(len(self.pad.tags)) if numbers is None else numbers
        return [self.sighting(number, index=index, **kinds) for index, number in enumerate(numbers)]
