"""Passes frames to the camera's pipeline, and its results to the publisher and the targets file. Pure.

A relay has no camera: nothing waits, nothing is due, and frames have no effect.
"""

from __future__ import annotations

from collections.abc import Mapping

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.pipeline.components import Components
from fwav_companion.pipeline.output_buffer import OutputBuffer
from fwav_companion.pipeline.target_log import TargetLog
from fwav_companion.self_calibration import KeptCalibration
from fwav_companion.tracking.filters.base import ReportedTarget
from fwav_companion.types import Frame, NoFrame, Reason
from fwav_companion.types.tracks import FinalPlace


class FrameHandlers:
    """Localizes, tracks, publishes and logs the detections of frames."""

    def __init__(self, components: Components, target_log: TargetLog, outputs: OutputBuffer, *, live: bool) -> None:
        """``live``: false in a replay, where no message is sent."""
        self._components = components
        self._target_log = target_log
        self._outputs = outputs
        self._live = live

    def of_frame(self, frame: Frame | NoFrame, now: HostNs) -> None:
        """Handle a decoded frame, or the reason why a datagram was rejected."""
        if isinstance(frame, NoFrame):
            self._target_log.drop_frames(frame.reason)
            if self._components.camera is not None and frame.reason is not Reason.OVERLOAD:
                self._components.camera.on_refused_frame(frame.reason, now)
        elif self._components.camera is not None:
            if self._components.spots is not None:
                self._components.spots.on_picture(frame)
            self._components.camera.on_frame(frame, now)
            self.take_ready(now)

    def take_ready(self, now: HostNs) -> int:
        """Localize, track and publish the frames whose attitudes are known. Returns the number of these frames."""
        if self._components.camera is None:
            return 0
        taken = self._components.camera.frames_taken
        for seen in self._components.camera.take_ready(now):
            if self._live:
                situation = self._components.situation(now)
                publisher = self._components.publisher
                if self._components.spots is not None:
                    self._components.spots.on_tracks(seen.tracks)
                self._outputs.messages += publisher.on_tracks(seen.tracks, situation, seen.pixel_from_ned)
                if self._components.acting is not None:
                    self._components.acting.on_tracks(publisher.clicked, now, awaited=publisher.awaits_click)
                self._outputs.notify(publisher.notices(), now)
        return self._components.camera.frames_taken - taken

    def settle(self, now: HostNs) -> None:
        """Write the lines of the frames that are final."""
        if self._components.camera is not None:
            self._target_log.settle(self._components.camera.settle(now), self._components.telemetry.world.plane)

    def finish(self, now: HostNs) -> None:
        """Write the lines of all frames: the flight has ended."""
        if self._components.camera is not None:
            self._target_log.settle(self._components.camera.finish(now), self._components.telemetry.world.plane)

    @property
    def wake_at(self) -> HostNs | None:
        """Instant at which a frame has waited long enough, its lines are due, or self-calibration is due."""
        return None if self._components.camera is None else self._components.camera.wake_at

    @property
    def waiting_detections(self) -> int:
        """Number of detections in frames that wait for attitudes."""
        return 0 if self._components.camera is None else self._components.camera.waiting_detections

    @property
    def best_targets(self) -> Mapping[int, ReportedTarget]:
        """The targets of all live tracks, by id."""
        return {} if self._components.camera is None else self._components.camera.best_targets

    def final_places(self) -> dict[int, FinalPlace]:
        """Targets by the whole flight, by id; empty without a smoother that keeps it."""
        return {} if self._components.camera is None else self._components.camera.tracker.final_places()

    @property
    def calibration_to_keep(self) -> KeptCalibration | None:
        """Result of self-calibration that the next flight may start from; None without one."""
        report = None if self._components.camera is None else self._components.camera.calibration
        return None if report is None else report.keep

    @property
    def time_offset_s(self) -> float:
        """Configured delay of the camera's stamps, seconds."""
        return 0.0 if self._components.camera is None else self._components.camera.look.time_offset_s

    def assumed_arrival(self, frame: Frame) -> HostNs | None:
        """Assumed arrival time of a recorded frame without ``received_unix``; None while the clock is unknown."""
        return None if self._components.camera is None else self._components.camera.look.assumed_arrival(frame)
