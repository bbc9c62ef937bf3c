"""Periodic messages of a live service: heartbeats, TIMESYNC, rate requests, statuses, readiness. Pure."""

from __future__ import annotations

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.pipeline.components import Components
from fwav_companion.pipeline.event_handlers import EventHandlers
from fwav_companion.pipeline.output_buffer import OutputBuffer


class Speaker:
    """Sends the periodic messages of all rooms; a replay has none."""

    def __init__(self, components: Components, outputs: OutputBuffer, handlers: EventHandlers) -> None:
        self._components = components
        self._outputs = outputs
        self._handlers = handlers

    def dues(self) -> tuple[HostNs | None, ...]:
        """Instants of the next messages of each room, heartbeats excepted; None where a room has none."""
        components = self._components
        return (
            components.timesync.wake_at,
            components.rates.wake_at,
            components.publisher.wake_at,
            self._handlers.wake_at,
            None if components.acting is None else components.acting.wake_at,
        )

    def speak(self, now: HostNs) -> None:
        """Send all messages that are due."""
        components, messages = self._components, self._outputs.messages
        healthy = components.identity.autopilot is not None and not components.identity.autopilot_lost
        messages += components.identity.heartbeats(now, healthy)
        request = components.timesync.on_wake(now)
        if request is not None:
            messages.append(request)
            components.telemetry.clock.on_request(now)
        if components.rates.wake_at is not None and components.rates.wake_at <= now:
            messages += components.rates.on_wake(now)
            self._outputs.notify(components.rates.notices(), now)
        if components.publisher.wake_at is not None and components.publisher.wake_at <= now:
            messages += components.publisher.on_wake(now, components.situation(now))
            self._outputs.notify(components.publisher.notices(), now)
        if self._handlers.wake_at is not None and self._handlers.wake_at <= now:
            self._handlers.on_wake(now)
        self.act(now)

    def act(self, now: HostNs) -> None:
        """Send what is due about the selected target, and report it."""
        acting = self._components.acting
        if acting is None:
            return
        if acting.wake_at is not None and acting.wake_at <= now:
            self._outputs.messages += acting.on_wake(now, self._components.situation(now))
        self._outputs.notify(acting.notices(), now)
