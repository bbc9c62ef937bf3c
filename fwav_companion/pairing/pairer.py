"""Pairing: a detection and the vehicle's state at the capture of its row make a sighting, or a named refusal."""

from __future__ import annotations

from collections.abc import Collection
from math import hypot

import msgspec

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.geometry.vectors import ZERO3, Matrix3, Vector3
from fwav_companion.pairing.anchors import anchored
from fwav_companion.pairing.detection_rays import DetectionRays
from fwav_companion.pairing.mounted_camera import CapturePose, MountedCamera
from fwav_companion.pairing.paired_frame import CameraView, PairedFrame, RefusedFrame
from fwav_companion.pairing.placement import LATEST_NS, FramePlacer, PictureRows, Placement, both_clocks
from fwav_companion.pairing.protocols import TwoClocks, VehicleSource
from fwav_companion.pairing.timing import CameraTiming, RowClock
from fwav_companion.types import (
    Detection,
    ElevatedTarget,
    Frame,
    Lens,
    Ray,
    Reason,
    Sighting,
    StampClock,
    Unpaired,
)


class CapturedRow(msgspec.Struct, frozen=True, gc=False, kw_only=True):
    """Capture of the row of one detection."""

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
        standing: Collection[ElevatedTarget] = (),
        latest_ns: int = LATEST_NS,
    ) -> None:
        """``latest_ns``: age of a frame at its arrival beyond which it is refused."""
        self.lens = lens
        self.body_from_camera = body_from_camera
        self._camera = MountedCamera(lens, body_from_camera, lever_arm_m)
        self._rays = DetectionRays(lens, min_score, labels)
        self._rows = RowClock(timing or CameraTiming())
        self._frames = FramePlacer(lens.image_size, self._rows, latest_ns)
        self._pixel_sigma = (pixel_noise_px, pixel_noise_px)
        self._standing = {target.label: target for target in standing}
        self._last_number = -1

    @property
    def image_centre(self) -> tuple[float, float]:
        """Centre of the picture, pixels of the calibration."""
        width, height = self.lens.image_size
        return ((width - 1) / 2, (height - 1) / 2)

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
        """The autopilot instant that attitudes should reach before pairing (see :class:`FramePlacer`)."""
        return self._frames.attitude_needed_until(frame, clock)

    def assumed_arrival(self, frame: Frame, clock: TwoClocks) -> HostNs | Unpaired:
        """Assumed arrival time of a recorded frame without ``received_unix``."""
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
        view = None if isinstance(state, Unpaired) else self._camera.camera_view(state, relative=vehicle.world.relative)
        poses: dict[int, CapturePose | Unpaired] = {}
        sightings: list[Sighting] = []
        refused: list[tuple[int, Reason, float | None]] = []
        for index, raw in enumerate(frame.detections):
            detection = placed.scaling.detection(raw)
            ray = self._rays.selected(detection)
            if isinstance(ray, Reason):
                refused.append((index, ray, None))
                continue
            row = self._row(placed, detection.v, number=number, index=index, clock=(clock_sigma_s, clock_rate))
            pose = poses.get(row.since_first_ns)
            if pose is None:
                at = vehicle.state_at(_row_boot_ns(row)) if row.since_first_ns else state
                pose = poses[row.since_first_ns] = self._camera.pose(
                    at, row.clock_rate, relative=vehicle.world.relative
                )
            if isinstance(pose, Unpaired):
                refused.append((index, pose.reason, pose.gap_s))
                continue
            sighting = self._sighting(row, detection, ray, pose)
            standing = self._standing.get(detection.label)
            sightings.append(sighting if standing is None else anchored(sighting, standing, self.lens))
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
        return None if isinstance(state, Unpaired) else self._camera.camera_view(state, relative=vehicle.world.relative)

    def picture_rows(self, frame: Frame, clock: TwoClocks) -> PictureRows | None:
        """Rows of a frame in time, and its scale, whether or not it is paired; None without a known clock or size."""
        return self._frames.picture_rows(frame, clock)

    def look_at(
        self, u: float, v: float, *, sigma_px: float | None, host_ns: HostNs, vehicle: VehicleSource
    ) -> Sighting | Unpaired:
        """The sighting of a pixel at this host instant, for an operator's click; the row is not considered.

        ``sigma_px`` None: the configured pixel noise, as for a detection without a sigma.
        """
        detection = Detection(u=u, v=v, sigma=None if sigma_px is None else (sigma_px, sigma_px))
        ray = self._rays.ray(detection)
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
        pose = self._camera.pose(vehicle.state_at(_row_boot_ns(row)), row.clock_rate, relative=vehicle.world.relative)
        return pose if isinstance(pose, Unpaired) else self._sighting(row, detection, ray, pose)

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


def _row_boot_ns(row: CapturedRow) -> BootNs:
    return BootNs(row.first_boot_ns + round(row.clock_rate * row.since_first_ns))
