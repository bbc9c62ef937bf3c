"""Detection + vehicle -> Sighting, or the reason why not."""

from __future__ import annotations

from collections.abc import Collection
from math import hypot, isfinite

import msgspec

from fwav_companion.geometry.rotations import matrix_from_quaternion
from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.geometry.vectors import ZERO3, Matrix3, Vector3, add, multiply, transform
from fwav_companion.pairing.placement import FramePlacer, both_clocks
from fwav_companion.pairing.protocols import TwoClocks, VehicleSource
from fwav_companion.pairing.timing import CameraTiming, RowClock
from fwav_companion.pairing.view import CameraView
from fwav_companion.types import (
    Detection,
    Frame,
    Lens,
    NoRay,
    Ray,
    Reason,
    Sighting,
    StampClock,
    Unpaired,
    VehicleState,
)


class PairedFrame(msgspec.Struct, frozen=True):
    """One frame that was placed in time."""

    number: int
    """Its own, or counted."""
    host_ns: HostNs
    """Capture of row 0, host clock."""
    boot_ns: BootNs
    """The same on the autopilot's."""
    state: VehicleState | Unpaired
    """The vehicle then."""
    view: CameraView | None
    """The camera then; None where it could not be placed. In a relative world it stands on the height above home,
    where that is known; whoever knows the height better replaces it."""
    sightings: tuple[Sighting, ...]
    refused: tuple[tuple[int, Reason, float | None], ...]
    """Of the other detections: index, reason, and the gap to the nearest attitude in seconds where it is known."""


class CapturedRow(msgspec.Struct, frozen=True, gc=False):
    """One detection's row in time."""

    frame: int
    index: int
    """Of the detection in its frame."""
    first_host_ns: HostNs
    """Capture of row 0."""
    since_first_ns: int
    """Until this row's."""


class RefusedFrame(msgspec.Struct, frozen=True):
    """A frame that is refused whole."""

    number: int | None
    reason: Reason
    detections: int
    """How many it held."""


class Pairer:
    """Places every detection of a frame at the instant its own row was exposed.

    What frames have shown (duplicates, their rate) is remembered by the :class:`FramePlacer`; the rest is handed in.
    """

    def __init__(
        self,
        *,
        lens: Lens,
        body_from_camera: Matrix3,
        lever_arm_m: Vector3 = ZERO3,
        timing: CameraTiming | None = None,
        pixel_noise_px: float = 4.0,
        min_score: float = 0.0,
        labels: Collection[str] = (),
    ) -> None:
        self.lens = lens
        self.body_from_camera = body_from_camera
        self._lever_arm_m = lever_arm_m
        self._rows = RowClock(timing or CameraTiming())
        self._frames = FramePlacer(lens.image_size, self._rows)
        self._pixel_sigma = (pixel_noise_px, pixel_noise_px)
        self._min_score = min_score
        self._labels = frozenset(labels)
        self._last_number = -1

    @property
    def time_offset_s(self) -> float:
        """How late stamps are taken to come."""
        return self._rows.time_offset_s

    @property
    def readout_s(self) -> float:
        """In use now: as configured, or half the median frame interval."""
        return self._rows.readout_s

    @property
    def readout_sigma_s(self) -> float:
        """One sigma of it, one bias through a flight; 0 where it is configured."""
        return self._rows.readout_sigma_s

    def recalibrate(self, body_from_camera: Matrix3, time_offset_s: float) -> None:
        """Take what self-calibration found, for frames from now on."""
        self.body_from_camera = body_from_camera
        self._rows.set_time_offset(time_offset_s)

    def attitude_needed_until(self, frame: Frame, clock: TwoClocks) -> BootNs | None:
        """What attitudes should reach before the frame is paired (:meth:`FramePlacer.needs_until`)."""
        return self._frames.attitude_needed_until(frame, clock)

    def assumed_arrival(self, frame: Frame, clock: TwoClocks) -> HostNs | Unpaired:
        """When a recorded frame came that does not tell (:meth:`FramePlacer.arrival_untold`)."""
        return self._frames.assumed_arrival(frame, clock)

    def pair(self, frame: Frame, vehicle: VehicleSource) -> PairedFrame | RefusedFrame:
        """Place the frame and everything seen in it."""
        placed = self._frames.place(frame, vehicle.clock)
        if isinstance(placed, Reason):
            return RefusedFrame(frame.number, placed, len(frame.detections))
        timing, host_ns, boot_ns = placed.timing, placed.host_ns, placed.boot_ns
        number = self._last_number = self._last_number + 1 if frame.number is None else frame.number
        clock_sigma_s = 0.0 if frame.stamp_clock is StampClock.BOOT else vehicle.clock.estimate(host_ns).sigma_s
        state = vehicle.state_at(boot_ns)
        view = None if isinstance(state, Unpaired) else self._outlook(state, relative=vehicle.world.relative)
        sightings: list[Sighting] = []
        refused: list[tuple[int, Reason, float | None]] = []
        by_readout = self._rows.readout_scale
        for index, raw in enumerate(frame.detections):
            detection = placed.scaling.detection(raw)
            seen = self._look(detection)
            if isinstance(seen, Reason):
                refused.append((index, seen, None))
                continue
            row = CapturedRow(number, index, host_ns, timing.capture_ns(detection.v) - timing.first_row_ns)
            told = self._sighting(
                row, boot_ns, by_readout * timing.row_fraction(detection.v), detection, seen, clock_sigma_s, vehicle
            )
            if isinstance(told, Unpaired):
                refused.append((index, told.reason, told.gap_s))
            else:
                sightings.append(told)
        return PairedFrame(number, host_ns, boot_ns, state, view, tuple(sightings), tuple(refused))

    def look_at(
        self, u: float, v: float, sigma_px: float | None, host_ns: HostNs, vehicle: VehicleSource
    ) -> Sighting | Unpaired:
        """The ground ray under a pixel at this host instant, whatever its row: what an operator's click means.

        ``sigma_px`` None: as sharp as a detection that brings no sigma of its own.
        """
        detection = Detection(u=u, v=v, sigma=None if sigma_px is None else (sigma_px, sigma_px))
        ray = self._ray(detection)
        if isinstance(ray, Reason):
            return Unpaired(ray)
        both = both_clocks(host_ns, StampClock.HOST, vehicle.clock)
        if isinstance(both, Unpaired):
            return both
        clock_sigma_s = vehicle.clock.estimate(host_ns).sigma_s
        return self._sighting(CapturedRow(-1, 0, host_ns, 0), both[1], 0.5, detection, ray, clock_sigma_s, vehicle)

    def _sighting(
        self,
        row: CapturedRow,
        boot_ns: BootNs,
        row_fraction: float,
        detection: Detection,
        ray: Ray,
        clock_sigma_s: float,
        vehicle: VehicleSource,
    ) -> Sighting | Unpaired:
        """The detection with the vehicle as it was when the row was exposed; ``boot_ns`` is that of row 0."""
        at = vehicle.state_at(BootNs(boot_ns + row.since_first_ns))
        if isinstance(at, Unpaired):
            return at
        if isinstance(at.gimbal, Reason):
            return Unpaired(at.gimbal)
        seen_from = self._view(at, relative=vehicle.world.relative)
        if seen_from is None:
            return Unpaired(Reason.NO_POSITION, at.gap_s)
        return Sighting(
            frame=row.frame,
            index=row.index,
            frame_host_ns=row.first_host_ns,
            host_ns=HostNs(row.first_host_ns + row.since_first_ns),
            detection=detection,
            ray=ray,
            pixel_sigma=detection.sigma or self._pixel_sigma,
            row_fraction=row_fraction,
            time_noise_s=hypot(clock_sigma_s, at.stamp_sigma_s),
            state=at,
            body_from_camera=self.body_from_camera,
            ned_from_camera=seen_from.ned_from_camera,
            camera_ned=seen_from.camera_ned,
            camera_height_above_home_m=self._camera_height(at),
            relative=vehicle.world.relative is True,
        )

    def _look(self, detection: Detection) -> Ray | Reason:
        """The ray of a detection, or why it is refused whatever the vehicle did."""
        if not _finite(detection):
            return Reason.NOT_FINITE
        if detection.score is not None and not detection.score >= self._min_score:
            return Reason.LOW_SCORE
        if self._labels and detection.label not in self._labels:
            return Reason.OTHER_LABEL
        return self._ray(detection)

    def _ray(self, detection: Detection) -> Ray | Reason:
        width, height = self.lens.image_size
        if not (-0.5 <= detection.u <= width - 0.5 and -0.5 <= detection.v <= height - 0.5):
            return Reason.OUTSIDE_IMAGE
        ray = self.lens.camera_ray_and_derivatives_from_pixel(detection.u, detection.v)
        return ray.reason if isinstance(ray, NoRay) else ray

    def _view(self, state: VehicleState, *, relative: bool | None) -> CameraView | None:
        """The camera at this state; None where its place is expected and not known, or its gimbal's attitude is not."""
        if isinstance(state.gimbal, Reason):
            return None
        ned_from_camera = multiply(matrix_from_quaternion(state.ned_from_carrier), self.body_from_camera)
        if relative:
            return CameraView(self.lens, ned_from_camera, ZERO3)
        if state.position_ned is None:
            return None
        arm_ned = transform(matrix_from_quaternion(state.ned_from_body), self._lever_arm_m)
        return CameraView(self.lens, ned_from_camera, add(state.position_ned, arm_ned))

    def _outlook(self, state: VehicleState, *, relative: bool | None) -> CameraView | None:
        """The camera in the world that tracks live in: a relative one has its zero on the ground below the camera."""
        view = self._view(state, relative=relative)
        if view is None or not relative:
            return view
        height_m = self._camera_height(state)
        return None if height_m is None else msgspec.structs.replace(view, camera_ned=(0.0, 0.0, -height_m))

    def _camera_height(self, state: VehicleState) -> float | None:
        if state.height_above_home_m is None:
            return None
        return state.height_above_home_m - transform(matrix_from_quaternion(state.ned_from_body), self._lever_arm_m)[2]


def _finite(detection: Detection) -> bool:
    if not (isfinite(detection.u) and isfinite(detection.v)):
        return False
    if detection.score is not None and not isfinite(detection.score):
        return False
    return detection.sigma is None or all(isfinite(s) and s > 0.0 for s in detection.sigma)
