"""Applies the events of one room to the other rooms, and reports readiness. Pure."""

from __future__ import annotations

from collections.abc import Iterable

from fwav_companion.acting.permission import End
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.client.identity_events import (
    Adopted,
    ArmedChanged,
    AutopilotBack,
    AutopilotLost,
    IdentityEvent,
)
from fwav_companion.pipeline.components import Components
from fwav_companion.pipeline.notices import notice_text
from fwav_companion.pipeline.output_buffer import OutputBuffer
from fwav_companion.pipeline.target_log import TargetLog
from fwav_companion.pipeline.world_handlers import WorldHandlers
from fwav_companion.publishing.landing import DEFAULT_LAG_S, LEAST_LAG_S, MOST_LAG_S
from fwav_companion.publishing.readiness import Readiness, ReadinessReports
from fwav_companion.telemetry import (
    ClockContradicted,
    HomeMoved,
    LocalWorld,
    OriginSet,
    PositionJumped,
    PositionSource,
    Rebooted,
    RelativeWorld,
    TakeOffFound,
    TelemetryEvent,
)
from fwav_companion.types import ClockExchange, Message, Notice, Outgoing, Reason


class EventHandlers:
    """Applies events of the autopilot's identity, of its clock, and of the world to the rooms."""

    def __init__(
        self, components: Components, target_log: TargetLog, outputs: OutputBuffer, *, unix_offset_ns: int, live: bool
    ) -> None:
        self._components = components
        self._target_log = target_log
        self._outputs = outputs
        self._live = live
        self.world = WorldHandlers(components, target_log, outputs, unix_offset_ns, self.forget_targets)
        self._readiness = ReadinessReports()

    @property
    def wake_at(self) -> HostNs | None:
        """Instant of the next readiness check; None without a camera, and while no autopilot is received."""
        return self._readiness.wake_at if self._components.camera is not None else None

    def on_wake(self, now: HostNs) -> None:
        """Check the readiness and report a change."""
        readiness = self._current_readiness(now)
        self._report(self._readiness.on_wake(readiness, now) if readiness is not None else None, now)

    def of_request(self, message: Message, now: HostNs) -> None:
        """Answer a request to this service. A heartbeat keeps the requests of its sender."""
        components = self._components
        if message.name == "HEARTBEAT":
            components.publisher.on_heartbeat(message, now)
            return
        self._outputs.messages += components.commands.on_message(message, components.situation(now))
        self._outputs.notify(components.publisher.notices(), now)

    def of_identity(self, events: Iterable[IdentityEvent], now: HostNs) -> None:
        """Handle an autopilot that was adopted, armed, lost, or is back."""
        for event in events:
            if isinstance(event, Adopted):
                if event.before is not None:
                    self._start_over(now)
                self._components.adopted_ns = now
                self._components.timesync.adopt(event.autopilot, now)
                self._components.rates.adopt(event.autopilot, now)
            self._outputs.notify(notice_text(event), now)
            match event:
                case Adopted() | AutopilotBack():
                    self._readiness.begin(now)
                case AutopilotLost():
                    self._readiness.stop()
                    self._end_acting(End.AUTOPILOT_LOST, now)
                case ArmedChanged(armed=False):
                    self._components.publisher.landing.on_disarmed(now)
                case ArmedChanged(armed=True) if self._live:
                    readiness = self._current_readiness(now)
                    self._report(self._readiness.on_armed(readiness, now) if readiness is not None else None, now)

    def _start_over(self, now: HostNs) -> None:
        """Forget everything of the former vehicle: its telemetry, its world, and all tracks."""
        components = self._components
        plane = components.telemetry.world.plane
        components.telemetry.start_over()
        components.publisher.landing.lag_s = DEFAULT_LAG_S
        self._end_acting(End.REPLACED, now)
        if components.camera is not None:
            components.camera.drop_all(Reason.VEHICLE_CHANGED)
            self.forget_targets(now)
            self._target_log.settle(components.camera.settle(now), plane)

    def forget_targets(self, now: HostNs) -> None:
        """Forget the targets, whose tracks or local frame ended: they are not published and not acted on."""
        self._components.publisher.forget_targets()
        self._end_acting(End.TARGET_LOST, now)

    def _end_acting(self, end: End, now: HostNs) -> None:
        if self._components.acting is not None:
            self._components.acting.on_end(end, now)

    def of_parameters(self) -> None:
        """Pass the autopilot's PLND_LAG to the landing, limited as ArduPilot limits it."""
        landing = self._components.publisher.landing
        lag_s = self._components.rates.parameters.get("PLND_LAG")
        if lag_s is not None:
            landing.lag_s = min(max(lag_s, LEAST_LAG_S), MOST_LAG_S)

    def of_timesync(self, message: Message, now: HostNs) -> None:
        """Handle a TIMESYNC message: an answer updates the clock, a request is answered."""
        result = self._components.timesync.on_message(message, now)
        if isinstance(result, ClockExchange):
            telemetry = self._components.telemetry
            self.of_telemetry(telemetry.on_exchange(result), now)
            if telemetry.clock.agreed:
                self._components.timesync.agreed()
                self._components.rates.open_gate(now)
            if telemetry.clock.wants_more:
                self._components.timesync.settle(now)
        elif isinstance(result, Outgoing) and self._live:
            self._outputs.messages.append(result)

    def of_telemetry(self, events: Iterable[TelemetryEvent], now: HostNs) -> None:
        """Handle telemetry events, such as a reboot, the world's origin or a moved home."""
        for event in events:
            match event:
                case ClockContradicted():
                    self._components.timesync.settle(now)
                case Rebooted(frame_ended=ended):
                    if ended:
                        self.world.drop_tracks(now)
                    self._components.timesync.restart(now)
                    self._components.rates.ask_again("the autopilot rebooted", now)
                    self._end_acting(End.REBOOTED, now)
                    self._readiness.begin(now)
                case (
                    OriginSet()
                    | RelativeWorld()
                    | LocalWorld()
                    | PositionSource()
                    | TakeOffFound()
                    | HomeMoved()
                    | PositionJumped()
                ):
                    self.world.handle(event, now)
            self._outputs.notify(notice_text(event), now)
        self.world.place_ground_by_geoid(now)

    def _current_readiness(self, now: HostNs) -> Readiness | None:
        camera = self._components.camera
        return None if camera is None else self._components.readiness(camera, now)

    def _report(self, notice: Notice | None, now: HostNs) -> None:
        if notice is not None:
            self._outputs.notify((notice,), now)
