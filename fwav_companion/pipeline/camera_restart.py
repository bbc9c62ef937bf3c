"""The camera's pipeline is built anew where internal faults repeat. Pure."""

from __future__ import annotations

from collections import deque

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.pipeline.camera_pipeline import CameraPipeline
from fwav_companion.pipeline.components import Components
from fwav_companion.pipeline.event_handlers import EventHandlers
from fwav_companion.pipeline.output_buffer import OutputBuffer
from fwav_companion.types import Notice, NoticeCode, Severity

FAULTS = 5
WITHIN_NS = 10 * NS_PER_S
"""FAULTS internal faults within this time have a cause that stays: the state of a room, not one input."""
LEAST_INTERVAL_NS = 60 * NS_PER_S
"""Shortest time between two restarts: where one does not help, the next does not either."""
TEXT = (
    "internal faults repeat: tracking starts anew without a kept calibration, and LANDING_TARGET is withheld until a"
    " target is found again; please report the log"
)


class CameraRestart:
    """Restarts localization, tracking and self-calibration; identity, routes, signing and clock stay as they are.

    While the next restart has to wait, the vehicle has no camera: what fails is not tried, and all else goes on.
    """

    def __init__(self, components: Components, handlers: EventHandlers, outputs: OutputBuffer) -> None:
        self._components = components
        self._handlers = handlers
        self._outputs = outputs
        self._camera = components.camera
        self._faults: deque[HostNs] = deque(maxlen=FAULTS)
        self._last_ns: HostNs | None = None
        self.wake_at: HostNs | None = None
        """Instant of a restart that waits; None without one."""

    def on_fault(self, now: HostNs) -> None:
        """Count an internal fault, and restart where they repeat."""
        self._faults.append(now)
        camera = self._camera
        if camera is None or self.wake_at is not None or len(self._faults) < FAULTS:
            return
        if now - self._faults[0] > WITHIN_NS:
            return
        if self._last_ns is None or now - self._last_ns >= LEAST_INTERVAL_NS:
            self._restart(camera, now)
            return
        self.wake_at = HostNs(self._last_ns + LEAST_INTERVAL_NS)
        self._components.camera = None
        self._handlers.forget_targets(now)

    def on_wake(self, now: HostNs) -> None:
        """Restart where that was due."""
        if self._camera is not None and self.wake_at is not None and now >= self.wake_at:
            self._restart(self._camera, now)

    def _restart(self, camera: CameraPipeline, now: HostNs) -> None:
        components = self._components
        self._last_ns, self.wake_at = now, None
        self._faults.clear()
        camera.rebuild()
        components.camera = camera
        self._handlers.forget_targets(now)
        if components.spots is not None:
            components.spots.on_tracks(())
        camera.home_moved(components.telemetry.world.home_down_m)
        self._handlers.world.place_ground(now)
        self._outputs.notify((Notice(NoticeCode.STARTED_ANEW, Severity.ERROR, TEXT, to_ground=True),), now)
