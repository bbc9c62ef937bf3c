"""The camera and its detector: exact projection row by row, then noise, missed detections, clutter and latency.
Pure.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import exp, hypot, isfinite
from typing import Any

from sitl_mock.camera_noise import CameraNoise, SharedStream, StreamsByCause
from sitl_mock.clock import BootClock
from sitl_mock.draws import DrawnBiases, radians3
from sitl_mock.flight import Flight
from sitl_mock.gimbal import Gimbal
from sitl_mock.lens import Lens, Pixel
from sitl_mock.options import Options
from sitl_mock.pads import PadTags
from sitl_mock.rotation import (
    FORWARD_CAMERA,
    Matrix,
    Vector,
    apply,
    apply_transposed,
    matrix_from_euler,
    matrix_from_rotation_vector,
    minus,
    plus,
    times,
)
from sitl_mock.scene import CORNERS, Target
from sitl_mock.surface import Surface
from sitl_mock.tags import GroundTag, tags

ROW_SETTLED_PX = 1e-7
CLUTTER = -1
"""Source index of a detection that has no target, in FrameTruth.sources."""


@dataclass(frozen=True)
class FrameTruth:
    """Truth about one frame."""

    frame: int
    row0_flight_s: float
    """Flight time of the middle of row 0's exposure, seconds (with a negative readout: of the bottom row, which the
    stamp marks)."""
    sources: tuple[int, ...]
    """Target index of each detection; -1 for clutter and outliers."""
    visible: tuple[int, ...]
    """Indices of the targets in view."""


class MockCamera:
    """Camera without a clock of its own: ``advance(now)`` returns (instant of delivery, detections by the contract,
    truth).
    """

    def __init__(
        self,
        options: Options,
        biases: DrawnBiases,
        flight: Flight,
        scene: list[Target],
        clock: BootClock,
        start_host_ns: int,
        unix_minus_host_s: float,
        gimbal: Gimbal,
    ) -> None:
        self._o, self._c = options, options.camera
        self._biases, self._flight, self._scene = biases, flight, scene
        self._clock, self._start, self._unix_minus_host_s = clock, start_host_ns, unix_minus_host_s
        self.lens = Lens(options.camera)
        self.body_from_camera = true_mount(options, biases)
        """gimbal_from_camera where the camera is on a gimbal."""
        self._position_m = plus(self._c.position_m, biases.lever_arm_m)
        self._gimbal = gimbal
        self._surface = Surface(options)
        self._noise: CameraNoise = (StreamsByCause if options.noise_by_cause else SharedStream)(options.seed)
        self._tags: dict[int, GroundTag] = {}
        if self._c.corner_noise_px is not None:
            self._tags = {tag.target: tag for tag in tags(options, scene)}
        self._pad_tags = PadTags(options.camera, options.seed, self.lens, self.rolled_pixel)
        self._frame = 0
        self.wake_at = self._ready_ns()
        """Instant at which the last row of the next frame has been read; None: the camera is off or has stopped."""

    def _ready_ns(self) -> int | None:
        row0_s = self.row0_s(self._frame)
        stops_at_s = self._c.stops_at_s
        if not self._c.enabled or (stops_at_s is not None and row0_s >= stops_at_s):
            return None
        return self._start + round((row0_s + abs(self._biases.readout_s)) * 1e9)

    def advance(self, now_ns: int) -> list[tuple[int, dict[str, Any], FrameTruth]]:
        """Returns the frames whose last row has been read by now."""
        frames = []
        while self.wake_at is not None and self.wake_at <= now_ns:
            frames.append((self.wake_at + round(self._latency_s() * 1e9), *self._shot()))
            self._frame += 1
            self.wake_at = self._ready_ns()
        return frames

    def row0_s(self, frame: int) -> float:
        """Flight time at which the first row of a frame is exposed, seconds."""
        return self._c.first_frame_s + frame / self._c.fps

    def due_ns(self, frame: int) -> int:
        """Host instant at which a frame leaves the camera: all rows read, and the constant latency passed."""
        return self._start + round((self.row0_s(frame) + abs(self._biases.readout_s) + self._c.latency_s) * 1e9)

    def stamp(self, frame: int) -> dict[str, float]:
        """Stamp of a frame, by the clock and the stamp rule of the options."""
        return self._stamp(self.row0_s(frame))

    def true_pixel(self, target: Target, row0_s: float) -> tuple[Pixel, float]:
        """(pixel, flight time of its row) of a target in the frame whose first row is exposed at row0_s."""
        return self.rolled_pixel(target.at, row0_s)

    def box(self, target: Target, row0_s: float) -> tuple[float, float, float, float]:
        """Left, top, right and bottom of a standing block in the image, cut off at the image's edges."""
        pixels = [self.rolled_pixel(partial(target.corner_at, corner), row0_s)[0] for corner in CORNERS]
        us, vs = [u for u, _ in pixels], [v for _, v in pixels]
        return (
            max(-0.5, min(us)),
            max(-0.5, min(vs)),
            min(self.lens.width - 0.5, max(us)),
            min(self.lens.height - 0.5, max(vs)),
        )

    def pixel_of(self, place: Vector, row0_s: float) -> Pixel:
        """Pixel of a fixed place in NED in the frame whose first row is exposed at row0_s."""
        return self.rolled_pixel(lambda _: place, row0_s)[0]

    def below(self, row0_s: float) -> tuple[float, float]:
        """North and east of the vehicle when the first row of a frame is exposed."""
        north, east, _ = self._flight.at(row0_s).position
        return north, east

    def rolled_pixel(self, place_at: Callable[[float], Vector], row0_s: float) -> tuple[Pixel, float]:
        """(pixel, flight time of its row) of a moving place in the frame whose first row is exposed at row0_s."""
        readout, height = self._biases.readout_s, self.lens.height
        pixel, t = (0.0, height / 2.0), row0_s
        for _ in range(20):
            share = pixel[1] / height
            t = row0_s + (readout * share if readout >= 0.0 else -readout * (1.0 - share))
            before, pixel = pixel, self._project(place_at(t), t)
            if not isfinite(pixel[0]) or abs(pixel[1] - before[1]) < ROW_SETTLED_PX:
                break
            # The row is limited: a row far outside the sensor has no exposure time.
            pixel = (pixel[0], max(-float(height), min(2.0 * height, pixel[1])))
        return pixel, t

    def _project(self, place: Vector, t: float) -> Pixel:
        position, euler = self._flight.pose(t)
        ned_from_body = matrix_from_euler(*euler)
        in_body = minus(apply_transposed(ned_from_body, minus(place, position)), self._position_m)
        if self._o.gimbal.device_id:
            in_ned = apply(ned_from_body, in_body)
            in_body = apply_transposed(self._gimbal.ned_from_gimbal(t), in_ned)
        return self.lens.pixel(apply_transposed(self.body_from_camera, in_body))

    def _latency_s(self) -> float:
        latency_s = self._c.latency_s
        if self._c.latency_jitter_s:
            latency_s += self._noise.latency.expovariate(1.0 / self._c.latency_jitter_s)
        if self._c.late_every and self._frame % self._c.late_every == self._c.late_every - 1:
            latency_s += self._c.late_by_s
        return latency_s

    def _shot(self) -> tuple[dict[str, Any], FrameTruth]:
        row0_s = self.row0_s(self._frame)
        found: list[tuple[int, str, Pixel]] = []
        of_pads: list[tuple[int, dict[str, Any]]] = []
        visible = []
        for index, target in enumerate(self._scene):
            self._noise.next_target()
            pixel, t = self.true_pixel(target, row0_s)
            if target.tags:
                if not self._surface.hides(target.at(t), self._flight.at(t).position):
                    of_pads.extend((index, each) for each in self._pad_tags.detections(target, row0_s))
                continue
            if target.height_m:
                left, top, right, bottom = self.box(target, row0_s)
                pixel = (0.5 * (left + right), 0.5 * (top + bottom))
            if not self.lens.sees(*pixel) or self._surface.hides(target.at(t), self._flight.at(t).position):
                continue
            visible.append(index)
            seen = self._detected(target, pixel, t)
            if index in self._tags and not self._whole(self._tags[index], row0_s):
                continue
            if seen is not None:
                found.append((index if seen[1] else CLUTTER, target.label, seen[0]))
        found.extend(
            (CLUTTER, self._noise.clutter.choice(self._scene).label, self._anywhere())
            for _ in range(self._false_ones())
        )
        self._noise.order.shuffle(found)
        message = {
            **self._stamp(row0_s),
            "frame": self._frame,
            "size": list(self._c.image_size),
            "exposure_s": self._c.exposure_s,
            "detections": [*(self._detection(*one, row0_s) for one in found), *(each for _, each in of_pads)],
        }
        visible.extend(sorted({index for index, _ in of_pads}))
        sources = (*(one[0] for one in found), *(index for index, _ in of_pads))
        return message, FrameTruth(self._frame, row0_s, sources, tuple(visible))

    def _detected(self, target: Target, pixel: Pixel, t: float) -> tuple[Pixel, bool] | None:
        """(noisy pixel, whether it belongs to the target), or None where the detection is missed or blurred away."""
        if self._noise.is_missed(self._c.missed):
            return None
        if self._c.max_blur_px and self._blur_px(target, t) > self._c.max_blur_px:
            return None
        if self._c.outliers and self._noise.clutter.random() < self._c.outliers:
            return self._anywhere(), False
        off_u, off_v = self._noise.offset(self._o.priors.pixel_noise_px)
        noisy = (pixel[0] + off_u, pixel[1] + off_v)
        return (noisy, True) if self.lens.sees(*noisy) else None

    def _blur_px(self, target: Target, t: float) -> float:
        half = self._c.exposure_s / 2.0
        (u0, v0), (u1, v1) = (self._project(target.at(at), at) for at in (t - half, t + half))
        return hypot(u1 - u0, v1 - v0)

    def _anywhere(self) -> Pixel:
        rng = self._noise.clutter
        return (rng.uniform(-0.5, self.lens.width - 0.501), rng.uniform(-0.5, self.lens.height - 0.501))

    def _false_ones(self) -> int:
        """Number of false detections: Poisson distributed, by Knuth's method."""
        if not self._c.clutter or not self._scene:
            return 0
        limit, product, count = exp(-self._c.clutter), self._noise.clutter.random(), 0
        while product > limit:
            product *= self._noise.clutter.random()
            count += 1
        return count

    def _whole(self, tag: GroundTag, row0_s: float) -> bool:
        """Whether all corners of a tag are in the image; a tag cut by the image's edge is not detected."""
        return all(self.lens.sees(*self.pixel_of(corner, row0_s)) for corner in tag.corners)

    def _corners(self, tag: GroundTag, row0_s: float) -> list[list[float]]:
        noise, sigma = self._noise.clutter, self._c.corner_noise_px or 0.0
        seen = (self._mirrored(self.pixel_of(corner, row0_s)) for corner in tag.corners)
        return [[round(u + noise.gauss(0.0, sigma), 4), round(v + noise.gauss(0.0, sigma), 4)] for u, v in seen]

    def _mirrored(self, pixel: Pixel) -> Pixel:
        u, v = pixel
        if self._c.mirrored == "left_right":
            u = self.lens.width - 1.0 - u
        elif self._c.mirrored == "top_bottom":
            v = self.lens.height - 1.0 - v
        return u, v

    def _detection(self, source: int, label: str, pixel: Pixel, row0_s: float) -> dict[str, Any]:
        u, v = self._mirrored(pixel)
        detection: dict[str, Any] = {"u": round(u, 6), "v": round(v, 6), "label": label, "score": 0.9}
        if self._c.tell_sigma and self._o.priors.pixel_noise_px:
            detection["sigma"] = self._o.priors.pixel_noise_px
        if self._c.tell_ids and source != CLUTTER:
            detection["id"] = source
        if source != CLUTTER and self._scene[source].height_m:
            left, top, right, bottom = self.box(self._scene[source], row0_s)
            across, along = 0.5 * (right - left), 0.5 * (bottom - top)
            detection["box"] = [round(x, 4) for x in (u - across, v - along, u + across, v + along)]
        if source in self._tags:
            detection["corners"] = self._corners(self._tags[source], row0_s)
        return detection

    def _stamp(self, row0_s: float) -> dict[str, float]:
        rule_s = {"row0_mid": 0.0, "row0_start": -0.5, "row0_end": 0.5}[self._c.stamp] * self._c.exposure_s
        late_s = self._c.time_offset_s + self._biases.time_offset_s + rule_s
        host_ns = self._start + round((row0_s + late_s) * 1e9)
        if self._c.stamp_clock == "time_boot":
            return {"time_boot": round(self._clock.boot_ns(host_ns) * 1e-9, 6)}
        if self._c.stamp_clock == "time_unix":
            stepped_s = sum(by_s for at_s, by_s in self._c.wall_steps if row0_s + late_s >= at_s)
            return {"time_unix": round(host_ns * 1e-9 + self._unix_minus_host_s + stepped_s, 6)}
        return {"time_monotonic": round(host_ns * 1e-9, 6)}


def true_mount(options: Options, biases: DrawnBiases) -> Matrix:
    """True body_from_camera (gimbal_from_camera on a gimbal): the configured mount turned by its bias."""
    configured = times(matrix_from_euler(*radians3(options.camera.mount_deg)), FORWARD_CAMERA)
    return times(matrix_from_rotation_vector(radians3(biases.mount_deg)), configured)


def datagram(frame: dict[str, Any]) -> bytes:
    """UDP payload with the detections of one frame."""
    return json.dumps(frame, separators=(",", ":")).encode()
