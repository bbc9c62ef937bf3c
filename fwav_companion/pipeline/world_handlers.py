"""Applies changes of the world's frame, of the home surface and of the positions to the other rooms. Pure."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot
from typing import Final, TypeAlias

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.pipeline.components import Components
from fwav_companion.pipeline.output_buffer import OutputBuffer
from fwav_companion.pipeline.target_log import TargetLog
from fwav_companion.pipeline.terrain_reports import TerrainReports
from fwav_companion.recording.line_types import HomeLine
from fwav_companion.recording.lines import origin_line, unix_seconds
from fwav_companion.telemetry import (
    HomeMoved,
    LocalWorld,
    OriginSet,
    PositionJumped,
    PositionSource,
    RelativeWorld,
    TakeOffFound,
)
from fwav_companion.types import Reason

WorldEvent: TypeAlias = (
    OriginSet | RelativeWorld | LocalWorld | PositionSource | TakeOffFound | HomeMoved | PositionJumped
)

LOCAL_POSITION_MESSAGES: Final = ("LOCAL_POSITION_NED", "EKF_STATUS_REPORT", "ESTIMATOR_STATUS")
"""Messages that a world in the autopilot's local frame needs: the position, and whether its filter vouches for it."""


class WorldHandlers:
    """Applies events of the world to the camera, the targets and the lines of the targets file."""

    def __init__(
        self,
        components: Components,
        target_log: TargetLog,
        outputs: OutputBuffer,
        unix_offset_ns: int,
        forget_targets: Callable[[HostNs], None],
    ) -> None:
        """``forget_targets``: called where all tracks ended."""
        self._components = components
        self._target_log = target_log
        self._unix_offset_ns = unix_offset_ns
        self._forget_targets = forget_targets
        self._terrain = TerrainReports(target_log, outputs, unix_offset_ns)
        self._placed_without_undulation = False

    def handle(self, event: WorldEvent, now: HostNs) -> None:
        """Apply one event."""
        match event:
            case OriginSet(origin, late):
                if late:
                    self.drop_tracks(now)
                self._target_log.origin_moved_in(now, origin)
                self.place_ground(now)
            case TakeOffFound():
                self.place_ground(now)
            case RelativeWorld():
                self._target_log.begin(None)
                self._want_local_position(now)
            case LocalWorld(late, home_down_m):
                if late:
                    self.drop_tracks(now)
                self._target_log.begin(None)
                self._set_home(home_down_m, now)
            case HomeMoved(down_m):
                self._set_home(down_m, now)
            case PositionSource() | PositionJumped():
                self._of_positions(event, now)

    def _of_positions(self, event: PositionSource | PositionJumped, now: HostNs) -> None:
        """Carry the tracks over a step of the positions, or to their other source: a step of the error, never of the
        targets. An origin that was found has its line already.
        """
        camera = self._components.camera
        if isinstance(event, PositionJumped):
            if camera is not None:
                camera.position_jumped(event.boot_ns, hypot(event.north_m, event.east_m))
            return
        if camera is not None and event.jump_sigma_m:
            camera.position_jumped(event.boot_ns, event.jump_sigma_m)
        if camera is not None and event.transfer_sigma_m:
            camera.origin_placed(event.boot_ns, event.transfer_sigma_m)
        if not event.transfer_sigma_m:
            self._target_log.write(origin_line(unix_seconds(now, self._unix_offset_ns), event.origin))

    def drop_tracks(self, now: HostNs) -> None:
        """End all tracks: the frame of their places ended."""
        camera = self._components.camera
        if camera is not None:
            camera.drop_all(Reason.ORIGIN_SET)
            self._forget_targets(now)
            self._target_log.settle(camera.settle(now), plane=None)

    def place_ground(self, now: HostNs) -> None:
        """Set the ground model's origin; repeated when the geoid is known, because an elevation model may need it."""
        telemetry, camera = self._components.telemetry, self._components.camera
        plane, take_off = telemetry.world.plane, telemetry.world.take_off
        if camera is None or plane is None or take_off is None:
            return
        self._placed_without_undulation = telemetry.undulation_m is None
        self._terrain.report(camera, camera.on_origin(plane, take_off, telemetry.undulation_m), now)

    def place_ground_by_geoid(self, now: HostNs) -> None:
        """Set the ground model's origin again where the geoid was not known then, and is now."""
        if self._placed_without_undulation and self._components.telemetry.undulation_m is not None:
            self.place_ground(now)

    def _set_home(self, down_m: float, now: HostNs) -> None:
        """Set the home surface to ``down_m`` below the origin."""
        if self._components.camera is not None:
            self._components.camera.home_moved(down_m)
        self._target_log.write(HomeLine(time_unix=unix_seconds(now, self._unix_offset_ns), down=down_m))

    def _want_local_position(self, now: HostNs) -> None:
        """Request the autopilot's local position and its filter's report: there is no global position."""
        telemetry, rates = self._components.telemetry, self._components.rates
        if self._components.camera is None:
            return
        if not telemetry.message_hz("LOCAL_POSITION_NED", now):  # a PX4 has been asked for it since its adoption
            rates.want("ODOMETRY", telemetry.message_hz("ODOMETRY", now), now)
        for name in LOCAL_POSITION_MESSAGES:
            rates.want(name, telemetry.message_hz(name, now), now)
