"""Processing of one camera's frames into tracks: waiting, pairing, localization, tracking. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from math import inf, prod

import msgspec

from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.stamps import NS_PER_S, BootNs, HostNs
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.localization import TerrainGround, TerrainShift
from fwav_companion.pairing import (
    RefusedFrame,
    VehicleSource,
    WaitingFrames,
    sees_nothing,
)
from fwav_companion.pipeline.camera_look import CameraLook
from fwav_companion.pipeline.camera_parts import CameraParts, MakeParts
from fwav_companion.pipeline.frame_census import FrameCensus
from fwav_companion.pipeline.landmark_notices import LandmarkNotices, landmark_reports
from fwav_companion.pipeline.landmark_shift import LandmarkShift
from fwav_companion.pipeline.pad_notices import CouldSee, PadNotices, with_pads
from fwav_companion.pipeline.self_calibration_notices import SelfCalibrationNotices
from fwav_companion.pipeline.target_log import TargetLog, sighting_lines
from fwav_companion.self_calibration import CalibrationReport, KeptCalibration
from fwav_companion.telemetry import RateMeter
from fwav_companion.tracking import FrameTracker, Settled
from fwav_companion.tracking.crowd import Crowd
from fwav_companion.tracking.filters.base import ReportedTarget
from fwav_companion.types import (
    Frame,
    FrameView,
    GroundFix,
    LandmarkRecord,
    NoFrame,
    Reason,
    Sighting,
    TakeOff,
    Track,
    Unpaired,
)
from fwav_companion.types.flight_status import LandmarkReport, SightReport

LONG_AFTER_NS = 60 * NS_PER_S
"""Time by which the clock is advanced at the end of a flight: longer than every wait and window."""

USED_NS = 2 * NS_PER_S
"""Time after a used picture in which second copies are no reason to be not ready."""
FOOTPRINT_NS = NS_PER_S
"""Age of the newest picture up to which its footprint is reported as the camera's present one."""


class ProcessedFrame(msgspec.Struct, frozen=True):
    """All tracks after one processed frame, with the camera's projection at its capture."""

    tracks: tuple[Track, ...]
    pixel_from_ned: Callable[[Vector3], tuple[float, float] | None] | None
    """Projects a position, NED, to its pixel in the frame's image; None where the camera's pose is unknown."""


class CameraPipeline:
    """Processes the frames of one camera."""

    def __init__(
        self,
        telemetry: VehicleSource,
        make_parts: MakeParts,
        target_log: TargetLog,
        *,
        kept: KeptCalibration | None,
        sightings: bool,
    ) -> None:
        """``kept``: a calibration of an earlier flight. ``sightings``: write a line for every detection."""
        self._telemetry = telemetry
        self._make_parts = make_parts
        self._target_log = target_log
        self._sightings = sightings
        target_log.landmarks = self._landmark_reports
        parts = make_parts(kept)
        self.look = CameraLook(telemetry, parts.pairer, parts.localizer)
        self._begin(parts)
        self._dropped: list[Settled] = []
        self.frames_taken = 0
        """Frames that left the queue for attitudes."""
        self.refused: Reason | None = None
        """Why the newest picture was refused; None where it was used."""
        self._last_frame_ns: HostNs | None = None

    def _begin(self, parts: CameraParts) -> None:
        """Begin with these rooms, and without a frame."""
        pairer = parts.pairer
        self.look.pairer, self.look.localizer = pairer, parts.localizer
        self._pairer, self._localizer, self._reorder = pairer, parts.localizer, parts.reorder
        self._agreement, self.readout, self._landmarks = parts.agreement, parts.readout, parts.landmarks
        self._pads, self.pad_news = parts.pads, PadNotices(parts.pads)
        self._image_px2 = float(prod(pairer.lens.image_size))
        self.calibration_news = SelfCalibrationNotices(pairer.body_from_camera, pairer.time_offset_s)
        self._shift = LandmarkShift(parts.landmarks.landmarks)
        self.landmark_news = LandmarkNotices()
        self._census = FrameCensus()
        self._waiting = WaitingFrames()
        self._last_view: FrameView | None = None
        self._jump: tuple[BootNs, float] | None = None
        """Instant and size, metres, of a jump of the vehicle's position that no frame has seen yet."""
        self._placed: tuple[BootNs, float] | None = None
        """Instant and one sigma, metres, of a placing of the world on the earth that no frame has seen yet."""
        self._meter = RateMeter()
        self._used_ns = HostNs(0)
        """Time of the last frame that was used."""

    def rebuild(self) -> None:
        """Make all rooms anew, without a kept calibration, and drop every track; their ids are not used again.

        What is in the old rooms may be what fails: the lines of their tracks are written where that succeeds.
        """
        next_id = self._reorder.tracker.next_id
        with suppress(Exception):
            self.drop_all(Reason.INTERNAL_FAULT)
            self._dropped = self._closed(HostNs(0))
        self._begin(self._make_parts(None))
        self._reorder.tracker.next_id = next_id

    @property
    def wake_at(self) -> HostNs | None:
        """Instant at which a frame has waited long enough, its lines are due, or self-calibration is due.

        Where lines are not used, no instant is needed for them: a frame is settled at the next event.
        """
        settles = self._reorder.wake_at if self._target_log.written else None
        dues = (self._waiting.wake_at, settles, self._reorder.tracker.due_ns)
        return min([due for due in dues if due is not None], default=None)

    @property
    def waiting_detections(self) -> int:
        """Number of detections in frames that wait for attitudes."""
        return self._waiting.detections

    def on_frame(self, frame: Frame, now: HostNs) -> None:
        """Take a frame that arrived; :meth:`take_ready` processes it, perhaps at once."""
        self._target_log.frames += 1
        self._last_frame_ns = now
        self._target_log.detections += len(frame.detections)
        clock = self._telemetry.clock
        self._census.add(frame, clock)
        until = self._pairer.attitude_needed_until(frame, clock)
        until_ns = None if until is None else clock.host_from_boot(until)
        if isinstance(until_ns, int):
            self._waiting.put(frame, until, until_ns, now)
        else:
            self._waiting.put_without_clock(frame, now)

    def on_refused_frame(self, reason: Reason, now: HostNs) -> None:
        """Record that a datagram arrived without a usable frame: a picture was sent, and refused."""
        self._last_frame_ns, self.refused = now, reason

    def take_ready(self, now: HostNs) -> list[ProcessedFrame]:
        """Process the frames whose attitudes are known or will not come."""
        if self._waiting.needs_clock and isinstance(self._telemetry.clock.boot_from_host(now), int):
            self._waiting.place(lambda frame: self._pairer.attitude_needed_until(frame, self._telemetry.clock), now)
        ready = self._waiting.take_ready(now, self._telemetry)
        if not ready:
            return []
        self.frames_taken += len(ready)
        return [seen for frame in ready if (seen := self._process(frame, now)) is not None]

    def settle(self, now: HostNs) -> list[Settled]:
        """Frames whose lines are final, in the order of capture."""
        self._reorder.tracker.catch_up(now)
        return self._closed(now)

    def _closed(self, now: HostNs) -> list[Settled]:
        settled, self._dropped = [*self._reorder.close(now), *self._dropped], []
        return settled

    @property
    def calibration(self) -> CalibrationReport | None:
        """Present result of self-calibration; None where it is off."""
        return self.tracker.calibration

    @property
    def tracker(self) -> FrameTracker:
        """The tracker of the present rooms."""
        return self._reorder.tracker

    @property
    def crowd(self) -> Crowd:
        """The labels of which more detections fit no track than new targets explain."""
        return self._reorder.tracker.crowd

    @property
    def best_targets(self) -> Mapping[int, ReportedTarget]:
        """The targets of all live tracks, by id."""
        return self._reorder.tracker.best_targets()

    @property
    def landmarks(self) -> tuple[LandmarkRecord, ...]:
        """Record of each landmark's sights so far; marked as not applied where the filter does not use landmarks."""
        return self._reorder.tracker.landmarks or self._landmarks.unapplied

    def footprint(self, size: tuple[int, int], now: HostNs) -> list[Vector3]:
        """Ground positions, NED, of the border of the newest picture; empty without a recent picture."""
        view = self._last_view
        if view is None or now - view.host_ns > FOOTPRINT_NS:
            return []
        return self.look.footprint(size, view.host_ns)

    def frames_hz(self, now: HostNs) -> float:
        """Rate of used frames, Hz, without second copies; 0 while none is."""
        return self._meter.rates_hz(now).get("frames", 0.0)

    def frame_age_s(self, now: HostNs) -> float:
        """Time since the newest frame arrived, seconds; infinite before the first."""
        return inf if self._last_frame_ns is None else (now - self._last_frame_ns) * 1e-9

    def status(self) -> SightReport:
        """Part of the status: the ground, the content of frames, and why the newest one was refused."""
        return SightReport(
            ground=self._localizer.ground.status(),
            refused=None if self.refused is None else self.refused.value,
            axis_elevation_deg=self.look.axis_elevation_deg(),
            heard=self._census.status(),
            agreement=self._agreement.status(),
            readout=self.readout.status(),
            landmarks=self._landmark_reports(),
            solves=self.tracker.solves,
        )

    def _landmark_reports(self) -> list[LandmarkReport]:
        return landmark_reports(self.landmarks)

    def home_moved(self, home_down_m: float) -> None:
        """Move the home surface."""
        self._localizer.home_moved(home_down_m)

    def on_origin(self, plane: TangentPlane, take_off: TakeOff, undulation_m: float | None) -> str:
        """Set the ground model's origin and take-off place; returns the model's notice, or ""."""
        self._landmarks.on_origin(plane)
        return self._localizer.on_origin(plane, take_off, undulation_m)

    def position_jumped(self, boot_ns: BootNs, jump_m: float) -> None:
        """Record a jump of the vehicle's reported position; the tracker allows for it in the next frame."""
        before_m = 0.0 if self._jump is None else self._jump[1]
        self._jump = (boot_ns, before_m + jump_m)

    def origin_placed(self, boot_ns: BootNs, sigma_m: float) -> None:
        """Record that a world without a place on the earth got one, with one sigma; the next frame's tracks have it."""
        self._placed = (boot_ns, sigma_m)

    def _placed_sigma_m(self, placed_ns: BootNs, sigma_m: float, boot_ns: BootNs) -> float:
        """One sigma of the pending placing if a frame of this instant is the first after it, metres; else 0."""
        if boot_ns < placed_ns:
            return 0.0
        self._placed = None
        return sigma_m

    def _jumped_m(self, boot_ns: BootNs) -> float:
        """Size of the pending jump if a frame of this instant is the first after it, metres; else 0."""
        if self._jump is None or boot_ns < self._jump[0]:
            return 0.0
        _, jump_m = self._jump
        self._jump = None
        return jump_m

    @property
    def terrain_shift(self) -> TerrainShift | None:
        """Shift of the elevation model; None on other grounds, and while it has none."""
        ground = self._localizer.ground
        return ground.shift if isinstance(ground, TerrainGround) else None

    def shift_by_landmark(self) -> str:
        """Shift the elevation model by a landmark's altitude, or undo such a shift; returns the notice, or ""."""
        return self._shift.applied(self._localizer.ground, self._reorder.tracker.landmark_altitude, self.landmarks)

    def drop_all(self, reason: Reason) -> None:
        """Drop every track for this reason."""
        view = self._last_view
        if view is not None:
            tracks = self._reorder.drop_all(reason, view)
            self._dropped.append(Settled(view, tracks))

    def finish(self, now: HostNs) -> list[Settled]:
        """End the flight: process the frames that wait, and settle all frames."""
        end_ns = HostNs(now + LONG_AFTER_NS)
        for frame in self._waiting.take_ready(end_ns, self._telemetry):
            self._process(frame, now)
        return self._closed(end_ns)

    def _process(self, frame: Frame, now: HostNs) -> ProcessedFrame | None:
        paired = self._pairer.pair(frame, self._telemetry)
        if isinstance(paired, RefusedFrame):
            # A second copy of a picture that was used is no trouble; a stamp that stands still is.
            copied = paired.reason is Reason.DUPLICATE_FRAME and now - self._used_ns < USED_NS
            self.refused = self.refused if copied else paired.reason
            self._target_log.refuse(paired, with_lines=self._sightings)
            return None
        self.refused, self._used_ns = None, now
        could_see: CouldSee = paired.view.could_see if paired.view is not None else sees_nothing
        if self._pads is not None:
            paired, could_see = with_pads(paired, self._pads), self._pads.could_see(could_see)
        # Frames that waited for the clock are used together, but did not arrive together.
        self._meter.count("frames", now if frame.arrival_ns is None else frame.arrival_ns)
        located = [self._localizer.locate(sighting) for sighting in paired.sightings]
        fixes, unplaced = list[GroundFix](), list[Sighting]()
        for sighting, fix in zip(paired.sightings, located, strict=True):
            if isinstance(fix, GroundFix):
                fixes.append(fix)
            else:
                unplaced.append(sighting)
        view = FrameView(
            frame=paired.number,
            host_ns=paired.host_ns,
            boot_ns=paired.boot_ns,
            fixes=tuple(fixes),
            could_see=could_see,
            vehicle_ned=paired.view.vehicle_ned if paired.view is not None else None,
            vehicle=None if isinstance(paired.state, Unpaired) else paired.state,
            unplaced=tuple(unplaced),
            image_px2=self._image_px2,
            jumped_m=self._jumped_m(paired.boot_ns),
            placed_sigma_m=0.0 if self._placed is None else self._placed_sigma_m(*self._placed, paired.boot_ns),
            landmarks=self._landmarks.sights(paired.sightings),
        )
        self._agreement.add(view.fixes, view.host_ns)
        self.readout.add(view.fixes)
        tracks = self._reorder.put(view, now)
        if isinstance(tracks, NoFrame):
            self._target_log.drop_frames(tracks.reason)
            return None
        self._target_log.count(paired, located)
        self._last_view = view
        if self._sightings:
            self._target_log.keep_sightings(view.host_ns, view.frame, sighting_lines(paired, located))
        return ProcessedFrame(tracks, paired.view.pixel_of if paired.view is not None else None)
