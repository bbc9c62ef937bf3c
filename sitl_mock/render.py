"""Rendered camera images: the ground through the mock's own lens, row by row, over the exposure, with noise.

A coarse grid of exact rays is intersected with the ground and interpolated: within the field of view the map from image
to ground is smooth enough that a spacing of 8 pixels costs some hundredths of a pixel, and a frame takes milliseconds.
"""

from __future__ import annotations

from math import ceil, cos, sin
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from sitl_mock.ground_picture import HAZE, Ground, Picture
from sitl_mock.options import CameraOptions
from sitl_mock.picture_grid import nodes, to_pixels
from sitl_mock.printed_tags import draw_tag
from sitl_mock.scene import Target
from sitl_mock.tag_view import TagView, tag_view
from sitl_mock.tags import AnyTag, pad_tags, tags

if TYPE_CHECKING:
    from sitl_mock.simulate import Simulation

SAMPLE_PX = 1.5
"""Largest spacing of the pictures whose mean is the motion blur, pixels."""
MOST_SAMPLES = 9
NOISE_LEVELS = 2.5
"""Sensor noise, one sigma, grey levels of 255."""
LENS_BLUR_PX = 0.6
STRAIGHT_DOWN_ENOUGH = 0.05
"""Smallest cosine from the vertical: a ray nearer to the horizon shows haze."""
VIGNETTE = 0.25
"""Fraction by which the corners are darker."""
Array = NDArray[np.float64]


class Eye:
    """Renders any frame of a simulation, in any order; a frame always gives the same picture."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._camera, self._c = simulation.camera, simulation.options.camera
        self._tags = tags(simulation.options, simulation.scene)
        self._ground = Ground(simulation.options.flight.centre, self._tags, simulation.options.seed)
        # Large tags first: a small one may lie in a blank of a large one.
        self._pad_tags = sorted(pad_tags(simulation.scene), key=lambda tag: -tag.printed.size_m)
        rays = camera_rays(self._c)
        self._rays = np.einsum("ij,rcj->rci", np.array(self._camera.body_from_camera), rays)
        self._shade = _vignette(self._c.image_size)
        width, height = self._c.image_size
        noise = np.random.default_rng(simulation.options.seed + 1).standard_normal((2 * height, 2 * width))
        self._noise = (NOISE_LEVELS * noise).astype(np.float32)

    def picture(self, frame: int) -> Picture:
        """Picture of a frame, (height, width) grey levels."""
        row0_s = self._camera.row0_s(frame)
        width, height = self._c.image_size
        samples = self._samples(row0_s)
        light = np.zeros((height, width), np.float32)
        for share in (np.arange(samples) + 0.5) / samples - 0.5:
            cv2.accumulate(self._instant(row0_s + share * self._c.exposure_s), light)
        light *= self._shade / samples
        light = cv2.GaussianBlur(light, (3, 3), LENS_BLUR_PX)
        light += self._noise_of(frame)
        picture: Picture = cv2.convertScaleAbs(np.maximum(light, 0.0))
        return picture

    def views(self, frame: int) -> list[TagView]:
        """Truth about every tag in this frame, those of pads, too."""
        row0_s = self._camera.row0_s(frame)
        every: list[AnyTag] = [*self._tags, *self._pad_tags]
        return [tag_view(self._camera, tag, row0_s, self._c.exposure_s) for tag in every]

    def _samples(self, row0_s: float) -> int:
        """Number of pictures for the motion blur, enough for the fastest row of the frame."""
        readout_s = self._simulation.biases.readout_s
        rates = (
            self._simulation.flight.rates(row0_s + share * abs(readout_s)) for share in (0.0, 0.25, 0.5, 0.75, 1.0)
        )
        fastest = max(sum(abs(rate) for rate in each) for each in rates)
        pixels_per_radian = self._c.k_mm[0] * max(self._c.pixels_per_mm)
        blur_px = fastest * self._c.exposure_s * pixels_per_radian
        return max(1, min(MOST_SAMPLES, ceil(blur_px / SAMPLE_PX)))

    def _instant(self, row0_s: float) -> Picture:
        """Sharp picture of an infinitely short exposure, row by row."""
        sights, size = self._sight_lines(row0_s), self._c.image_size
        x, y = (to_pixels(grid, (0, 0), size)[0] for grid in self._ground.texel(*sights.meet(np.zeros(1))))
        beyond = {"borderMode": cv2.BORDER_CONSTANT, "borderValue": HAZE}
        sharp: Picture = cv2.remap(self._ground.picture, x, y, cv2.INTER_LINEAR, **beyond)
        for tag in self._pad_tags:
            axes = sights.in_pad_axes(tag.pad)
            if axes is not None:
                draw_tag(sharp, tag, *axes)
        return sharp

    def _sight_lines(self, row0_s: float) -> SightLines:
        """Lines of sight of the grid's nodes, each row at its own instant."""
        readout_s, height = self._simulation.biases.readout_s, self._c.image_size[1]
        rows = nodes(height)
        instants, turned, places = [], np.empty((len(rows), 3, 3)), np.empty((len(rows), 3))
        for row, v in enumerate(rows):
            share = float(v) / height
            t = row0_s + (readout_s * share if readout_s >= 0.0 else -readout_s * (1.0 - share))
            state = self._simulation.flight.at(t)
            instants.append(t)
            turned[row] = state.ned_from_body
            places[row] = state.position
        places += turned @ np.add(self._c.position_m, self._simulation.biases.lever_arm_m)
        return SightLines(instants, places, np.einsum("rij,rcj->rci", turned, self._rays))

    def _noise_of(self, frame: int) -> NDArray[np.float32]:
        """Noise of a frame: for each frame a different part of the same noise image."""
        width, height = self._c.image_size
        top, left = (frame * 197) % height, (frame * 331) % width
        return self._noise[top : top + height, left : left + width]


class SightLines(NamedTuple):
    """Lines of sight of the grid's nodes, row by row."""

    instants: list[float]
    """Flight time of each row, seconds."""
    cameras: Array
    """(rows, 3) camera at each row's instant, NED, metres."""
    rays: Array
    """(rows, columns, 3) unit rays, NED."""

    def meet(self, down: Array) -> tuple[Array, Array]:
        """(rows, columns) north and east where the rays meet a level plane. ``down``: (rows,) or (1,), metres."""
        reach = (down - self.cameras[:, 2])[:, None] / np.maximum(self.rays[..., 2], STRAIGHT_DOWN_ENOUGH)
        north, east = (self.cameras[:, None, axis] + reach * self.rays[..., axis] for axis in (0, 1))
        return north, east

    def in_pad_axes(self, pad: Target) -> tuple[Array, Array] | None:
        """(rows, columns) forward and right of a pad's landing point, metres; None for a camera below the pad."""
        at = np.array([pad.at(t) for t in self.instants])
        if (self.cameras[:, 2] >= at[:, 2]).any():
            return None
        headings = [pad.heading_at(t) for t in self.instants]
        c, s = np.array([[cos(each), sin(each)] for each in headings]).T[..., None]  # (rows, 1) each
        north, east = self.meet(at[:, 2])
        north, east = north - at[:, None, 0], east - at[:, None, 1]
        return north * c + east * s, east * c - north * s


def camera_rays(camera: CameraOptions) -> Array:
    """Unit rays of the grid's nodes in the camera frame, (rows, columns, 3)."""
    width, height = camera.image_size
    u, v = np.meshgrid(nodes(width), nodes(height))
    x = (u - camera.principal_point[0]) / camera.pixels_per_mm[0]
    y = (v - camera.principal_point[1]) / camera.pixels_per_mm[1]
    r = np.hypot(x, y)
    theta = _angle(r, camera)
    across = np.where(r > 0.0, np.sin(theta) / np.maximum(r, 1e-12), 0.0)
    return np.stack([x * across, y * across, np.cos(theta)], axis=-1)


def _angle(r: Array, camera: CameraOptions) -> Array:
    """Theta by Newton's method: r(theta) is almost linear for every lens of this mock."""
    k1, k2, k3, k4, k5 = camera.k_mm
    theta = r / k1
    for _ in range(8):
        t2 = theta * theta
        value = theta * (k1 + t2 * (k2 + t2 * (k3 + t2 * (k4 + t2 * k5))))
        slope = k1 + t2 * (3 * k2 + t2 * (5 * k3 + t2 * (7 * k4 + t2 * 9 * k5)))
        theta = theta - (value - r) / slope
    return theta


def _vignette(size: tuple[int, int]) -> NDArray[np.float32]:
    width, height = size
    x = (np.arange(width) - (width - 1) / 2.0) / (width / 2.0)
    y = (np.arange(height) - (height - 1) / 2.0) / (height / 2.0)
    return (1.0 - VIGNETTE / 2.0 * np.add.outer(y * y, x * x)).astype(np.float32)
