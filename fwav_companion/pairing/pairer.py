"""Pairing: a detection and the vehicle's state at the capture of its row make a sighting, or a named refusal."""

from __future__ import annotations

from collections.abc import Collection
from math import hypot, isfinite

import msgspec

from fwav_companion.geometry.rotations import matrix_from_quaternion
from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.geometry.vectors import ZERO3, Matrix3, Vector3, add, multiply, scale, subtract, transform
from fwav_companion.pairing.anchors import anchor_of, marker_centre
from fwav_companion.pairing.paired_frame import CameraView, PairedFrame, RefusedFrame
from fwav_companion.pairing.placement import FramePlacer, PictureRows, Placement, both_clocks
from fwav_companion.pairing.protocols import TwoClocks, VehicleSource
from fwav_companion.pairing.timing import CameraTiming, RowClock
from fwav_companion.types import (
    Detection,
    Frame,
    GimbalAt,
    Lens,
    NoRay,
    Ray,
    Reason,
    Sighting,
    StampClock,
    StandingTarget,
    Unpaired,
    VehicleState,
)
from fwav_companion.types.spots import CLICK_LABEL


class CapturedRow(msgspec.Struct, frozen=True, gc=False, kw_only=True):
    """The row of one detection in time."""

    frame: int
    """Frame number."""
    index: int
    """Index of the detection in its frame."""
    first_host_ns: HostNs
    """Capture of row 0, host clock."""
    first_boot_ns: BootNs
    """Capture of row 0, autopilot clock."""
    since_first_ns: int
    """Time from the capture of row 0 to that of this row."""
    fraction: float
    """d(capture)/d(Bias.READOUT), as :attr:`Sighting.row_fraction`."""
    clock_sigma_s: float
    """One sigma of the clock offset that the stamp needed, seconds."""
    clock_rate: float
    """Autopilot seconds per second of the stamp's clock; 1 for a crystal's."""


class CapturePose(msgspec.Struct, frozen=True, gc=False):
    """The vehicle and its camera at one instant: the same for every detection of one row."""

    state: VehicleState
    ned_from_camera: Matrix3
    camera_ned: Vector3
    camera_height_m: float | None
    """Camera height above home, metres; None where it is not known."""
    relative: bool
    """Whether there is no global position."""


class Pairer:
    """Pairs every detection of a frame with the vehicle at the instant at which its row was exposed.

    :class:`FramePlacer` keeps the history of frames (duplicates, frame rate); the rest is passed in.
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
        standing: Collection[StandingTarget] = (),
    ) -> None:
        self.lens = lens
        self.body_from_camera = body_from_camera
        self._lever_arm_m = lever_arm_m
        self._rows = RowClock(timing or CameraTiming())
        self._frames = FramePlacer(lens.image_size, self._rows)
        self._pixel_sigma = (pixel_noise_px, pixel_noise_px)
        self._min_score = min_score
        self._labels = frozenset(labels)
        self._standing = {target.label: target for target in standing}
        self._last_number = -1

    @property
    def time_offset_s(self) -> float:
        """The time offset of the stamps in use, seconds; positive: stamps come late."""
        return self._rows.time_offset_s

    @property
    def readout_s(self) -> float:
        """The readout time in use, seconds: as configured, else half of the longest possible one."""
        return self._rows.readout_s

    @property
    def readout_sigma_s(self) -> float:
        """One sigma of the readout time, one bias through a flight, seconds; 0 where it is configured."""
        return self._rows.readout_sigma_s

    def attitude_needed_until(self, frame: Frame, clock: TwoClocks) -> BootNs | None:
        """The autopilot instant that attitudes should reach before pairing (:meth:`FramePlacer.needs_until`)."""
        return self._frames.attitude_needed_until(frame, clock)

    def assumed_arrival(self, frame: Frame, clock: TwoClocks) -> HostNs | Unpaired:
        """Assumed arrival time of a recorded frame without ``received_unix`` (:meth:`FramePlacer.arrival_untold`)."""
        return self._frames.assumed_arrival(frame, clock)

    def pair(self, frame: Frame, vehicle: VehicleSource) -> PairedFrame | RefusedFrame:
        """The frame on both clocks with its sightings, or the reason why it is refused."""
        placed = self._frames.place(frame, vehicle.clock)
        if isinstance(placed, Reason):
            return RefusedFrame(frame.number, placed, len(frame.detections))
        number = self._last_number = self._last_number + 1 if frame.number is None else frame.number
        clock_sigma_s, clock_rate = 0.0, 1.0
        if frame.stamp_clock is not StampClock.BOOT:
            clock_sigma_s = vehicle.clock.sigma_s_at(placed.host_ns)
            clock_rate = vehicle.clock.rate_at(placed.host_ns)
        state = vehicle.state_at(placed.boot_ns)
        view = None if isinstance(state, Unpaired) else self._outlook(state, relative=vehicle.world.relative)
        poses: dict[int, CapturePose | Unpaired] = {}
        sightings: list[Sighting] = []
        refused: list[tuple[int, Reason, float | None]] = []
        for index, raw in enumerate(frame.detections):
            detection = placed.scaling.detection(raw)
            ray = self._look(detection)
            if isinstance(ray, Reason):
                refused.append((index, ray, None))
                continue
            row = self._row(placed, detection.v, number=number, index=index, clock=(clock_sigma_s, clock_rate))
            pose = poses.get(row.since_first_ns)
            if pose is None:
                at = vehicle.state_at(_row_boot_ns(row)) if row.since_first_ns else state
                pose = poses[row.since_first_ns] = self._pose(at, row.clock_rate, relative=vehicle.world.relative)
            if isinstance(pose, Unpaired):
                refused.append((index, pose.reason, pose.gap_s))
                continue
            sighting = self._sighting(row, detection, ray, pose)
            standing = self._standing.get(detection.label)
            sightings.append(sighting if standing is None else self._anchored(sighting, standing))
        return PairedFrame(
            number=number,
            host_ns=placed.host_ns,
            boot_ns=placed.boot_ns,
            state=state,
            view=view,
            sightings=tuple(sightings),
            refused=tuple(refused),
        )

    def _row(self, placed: Placement, v: float, *, number: int, index: int, clock: tuple[float, float]) -> CapturedRow:
        timing = placed.timing
        return CapturedRow(
            frame=number,
            index=index,
            first_host_ns=placed.host_ns,
            first_boot_ns=placed.boot_ns,
            since_first_ns=timing.capture_ns(v) - timing.first_row_ns,
            fraction=self._rows.readout_scale * timing.row_fraction(v),
            clock_sigma_s=clock[0],
            clock_rate=clock[1],
        )

    def camera_at(self, host_ns: HostNs, vehicle: VehicleSource) -> CameraView | None:
        """The camera at this host instant, in the frame of the tracks; None where it is not known."""
        both = both_clocks(host_ns, StampClock.HOST, vehicle.clock)
        state = both if isinstance(both, Unpaired) else vehicle.state_at(both[1])
        return None if isinstance(state, Unpaired) else self._outlook(state, relative=vehicle.world.relative)

    def picture_rows(self, frame: Frame, clock: TwoClocks) -> PictureRows | None:
        """A frame in time and scale, whether or not it is paired; None where the clock or the size is not known."""
        return self._frames.picture_rows(frame, clock)

    def look_at(
        self, u: float, v: float, *, sigma_px: float | None, host_ns: HostNs, vehicle: VehicleSource
    ) -> Sighting | Unpaired:
        """The sighting of a pixel at this host instant, for an operator's click; the row is not considered.

        ``sigma_px`` None: the sigma of a detection that brings none.
        """
        detection = Detection(u=u, v=v, sigma=None if sigma_px is None else (sigma_px, sigma_px))
        ray = self._ray(detection)
        if isinstance(ray, Reason):
            return Unpaired(ray)
        both = both_clocks(host_ns, StampClock.HOST, vehicle.clock)
        if isinstance(both, Unpaired):
            return both
        row = CapturedRow(
            frame=-1,
            index=0,
            first_host_ns=host_ns,
            first_boot_ns=both[1],
            since_first_ns=0,
            fraction=0.5,
            clock_sigma_s=vehicle.clock.sigma_s_at(host_ns),
            clock_rate=vehicle.clock.rate_at(host_ns),
        )
        pose = self._pose(vehicle.state_at(_row_boot_ns(row)), row.clock_rate, relative=vehicle.world.relative)
        return pose if isinstance(pose, Unpaired) else self._sighting(row, detection, ray, pose)

    def _pose(self, at: VehicleState | Unpaired, clock_rate: float, *, relative: bool | None) -> CapturePose | Unpaired:
        """The pose of the camera at this state, or the reason why it is not known."""
        if isinstance(at, Unpaired):
            return at
        if clock_rate != 1.0:
            at = _per_stamp_second(at, clock_rate)
        if isinstance(at.gimbal, Reason):
            return Unpaired(at.gimbal)
        seen_from = self._view(at, relative=relative)
        if seen_from is None:
            return Unpaired(Reason.NO_POSITION, at.gap_s)
        return CapturePose(
            at, seen_from.ned_from_camera, seen_from.camera_ned, self._camera_height(at), relative is True
        )

    def _sighting(self, row: CapturedRow, detection: Detection, ray: Ray, pose: CapturePose) -> Sighting:
        """The detection with the state of the vehicle at the capture of its row."""
        return Sighting(
            frame=row.frame,
            index=row.index,
            frame_host_ns=row.first_host_ns,
            host_ns=HostNs(row.first_host_ns + row.since_first_ns),
            detection=detection,
            ray=ray,
            pixel_sigma=detection.sigma or self._pixel_sigma,
            row_fraction=row.fraction,
            time_noise_s=hypot(row.clock_sigma_s, pose.state.stamp_sigma_s),
            state=pose.state,
            body_from_camera=self.body_from_camera,
            ned_from_camera=pose.ned_from_camera,
            camera_ned=pose.camera_ned,
            camera_height_above_home_m=pose.camera_height_m,
            relative=pose.relative,
        )

    def _anchored(self, sighting: Sighting, target: StandingTarget) -> Sighting:
        """The sighting of the point that the detection of a standing target marks.

        The row stays that of the box's centre: over a box of 50 rows the readout of 30 ms lasts 3 ms longer.
        """
        anchor = anchor_of(target, sighting.detection, sighting.ned_from_camera, self.lens)
        ray = None if anchor.pixel is None else self.lens.camera_ray_and_derivatives_from_pixel(*anchor.pixel)
        return msgspec.structs.replace(
            sighting,
            ray=sighting.ray if ray is None or isinstance(ray, NoRay) else ray,
            anchor_height_m=anchor.height_m,
            anchor_sigma_m=anchor.sigma_m,
        )

    def _look(self, detection: Detection) -> Ray | Reason:
        """The ray of a detection, or the reason for its refusal; independent of the vehicle."""
        if not _finite(detection):
            return Reason.NOT_FINITE
        if detection.label != CLICK_LABEL:
            if detection.score is not None and not detection.score >= self._min_score:
                return Reason.LOW_SCORE
            if self._labels and detection.label not in self._labels:
                return Reason.OTHER_LABEL
        return self._ray(detection)

    def _ray(self, detection: Detection) -> Ray | Reason:
        width, height = self.lens.image_size
        if not (-0.5 <= detection.u <= width - 0.5 and -0.5 <= detection.v <= height - 0.5):
            return Reason.OUTSIDE_IMAGE
        u, v = (detection.u, detection.v) if detection.corners is None else marker_centre(detection, self.lens)
        ray = self.lens.camera_ray_and_derivatives_from_pixel(u, v)
        return ray.reason if isinstance(ray, NoRay) else ray

    def _view(self, state: VehicleState, *, relative: bool | None) -> CameraView | None:
        """The camera at this state; None where an expected position or the gimbal's attitude is not known."""
        if isinstance(state.gimbal, Reason):
            return None
        ned_from_camera = multiply(matrix_from_quaternion(state.ned_from_carrier), self.body_from_camera)
        if relative:
            return CameraView(self.lens, ned_from_camera, ZERO3)
        if state.position_ned is None:
            return None
        camera_ned = add(state.position_ned, self._arm_ned(state))
        return CameraView(self.lens, ned_from_camera, camera_ned, vehicle_ned=state.position_ned)

    def _outlook(self, state: VehicleState, *, relative: bool | None) -> CameraView | None:
        """The camera in the frame of the tracks: a relative world has its origin on the ground below the camera."""
        view = self._view(state, relative=relative)
        if view is None or not relative:
            return view
        height_m = self._camera_height(state)
        if height_m is None:
            return None
        camera_ned = (0.0, 0.0, -height_m)
        vehicle_ned = subtract(camera_ned, self._arm_ned(state))
        return CameraView(view.lens, view.ned_from_camera, camera_ned, vehicle_ned)

    def _camera_height(self, state: VehicleState) -> float | None:
        return None if state.height_above_home_m is None else state.height_above_home_m - self._arm_ned(state)[2]

    def _arm_ned(self, state: VehicleState) -> Vector3:
        """The camera's lever arm, NED."""
        if self._lever_arm_m == ZERO3:
            return ZERO3
        return transform(matrix_from_quaternion(state.ned_from_body), self._lever_arm_m)


def _per_stamp_second(state: VehicleState, rate: float) -> VehicleState:
    """The state with velocity and body rates per second of the stamp's clock, which a slow autopilot's is not."""
    velocity = state.velocity_ned
    gimbal = state.gimbal
    if isinstance(gimbal, GimbalAt):
        gimbal = msgspec.structs.replace(gimbal, rates=scale(gimbal.rates, rate))
    return msgspec.structs.replace(
        state,
        rates=scale(state.rates, rate),
        velocity_ned=None if velocity is None else scale(velocity, rate),
        gimbal=gimbal,
    )


def _finite(detection: Detection) -> bool:
    if not (isfinite(detection.u) and isfinite(detection.v)):
        return False
    if detection.score is not None and not isfinite(detection.score):
        return False
    if detection.sigma is None:
        return True
    su, sv = detection.sigma
    return su > 0.0 and sv > 0.0 and isfinite(su) and isfinite(sv)


def _row_boot_ns(row: CapturedRow) -> BootNs:
    return BootNs(row.first_boot_ns + round(row.clock_rate * row.since_first_ns))
