"""The pipeline on one page: messages and frames in; messages, lines and notices out. Pure: it is handed the time.

``run`` drives it from sockets, ``replay`` from files, tests from simulated time. Before every event it does what was
due earlier, at the time it was due: so the load of the machine does not change the estimates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.rate_messages import OwnStreams
from fwav_companion.mavlink.router.node import PassedRequest
from fwav_companion.pipeline.components import Components
from fwav_companion.pipeline.event_handlers import EventHandlers
from fwav_companion.pipeline.output_buffer import OutputBuffer, Outputs
from fwav_companion.pipeline.target_log import TargetLog
from fwav_companion.publishing.ground_messages import onboard_computer_status
from fwav_companion.recording.lines import Line, unix_seconds
from fwav_companion.self_calibration import KeptCalibration
from fwav_companion.telemetry import Telemetry
from fwav_companion.types import BoardReport, Destination, Frame, Message, NoFrame, Outgoing, Reason

ANSWERED = frozenset({"COMMAND_LONG", "COMMAND_INT", "PING"})
"""Requests that are answered from any sender."""
GIMBAL_ATTITUDE = "GIMBAL_DEVICE_ATTITUDE_STATUS"
"""The one message of telemetry that may come from another component of the vehicle."""
FAULT_SILENCE_NS = 6 * NS_PER_S
"""Silence after an internal fault, long enough for peers to notice: they allow five missed heartbeats."""


class Pipeline:
    """Pipeline of one flight. Every ``now`` is a host instant in whole microseconds that never decreases."""

    def __init__(self, rooms: Components, ledger: TargetLog, *, unix_offset_ns: int, live: bool = True) -> None:
        """``unix_offset_ns``: recording's clock minus host clock. ``live``: false in a replay: no message is sent."""
        self._rooms = rooms
        self._ledger = ledger
        self._unix_offset_ns = unix_offset_ns
        self._live = live
        self._clock_line_ns: HostNs | None = None
        self._fault_over_ns: HostNs | None = None
        self._due_ns: HostNs | None = None
        self._due_is_known = False
        self._outlet = OutputBuffer(rooms, ledger, live=live)
        self._consequences = EventHandlers(rooms, ledger, self._outlet, unix_offset_ns=unix_offset_ns, live=live)
        self._ended = False

    # What comes in.

    def on_message(self, message: Message, now: HostNs) -> None:
        """Handle a message from any sender."""
        self.advance(now)
        rooms = self._rooms
        self._consequences.of_identity(rooms.identity.on_message(message, now), now)
        if message.name == "TIMESYNC":
            self._consequences.of_timesync(message, now)
        rooms.rates.on_message(message, now)
        autopilot = rooms.identity.autopilot
        if autopilot and message.system == autopilot.system and message.name == GIMBAL_ATTITUDE:
            rooms.telemetry.on_gimbal(message, autopilot.component, now)
            self._take_ready(now)
        elif autopilot and message.system == autopilot.system and message.component == autopilot.component:
            self._consequences.of_telemetry(rooms.telemetry.on_message(message, now), now)
            self._take_ready(now)
        if self._live and message.name in ANSWERED:
            self._outlet.messages += rooms.commands.on_message(message, rooms.situation(now))
            self._outlet.notify(rooms.publisher.notices(), now)

    def on_own_message(self, message: Message, now: HostNs) -> None:
        """Handle a recorded message that we sent ourselves: our TIMESYNC requests are read from it."""
        self.advance(now)
        if message.name == "TIMESYNC" and message.fields.tc1 == 0:
            self._rooms.timesync.on_sent(message.fields.ts1, now)

    def on_rate_requests(
        self, passed: Sequence[PassedRequest], demanded: Mapping[int, float], now: HostNs
    ) -> list[Outgoing]:
        """Handle requests for message rates that were forwarded; returns our messages for the same write.

        ``demanded``: highest rate that stations want, hertz by message id.
        """
        rates = self._rooms.rates
        for one in passed:
            if not one.merged:
                rates.on_rate_request_passed(one.request.requester, now)
        self._due_is_known = False
        return rates.on_merged_requests([one.request for one in passed if one.merged], demanded, now)

    def stations_want(self, demanded: Mapping[int, float]) -> None:
        """The highest rate that stations want, hertz by message id; it changes when they fall silent too."""
        self._rooms.rates.stations_want(demanded)

    def on_frame(self, frame: Frame | NoFrame, now: HostNs) -> None:
        """Handle a decoded frame (possibly without detections), or the reason why a datagram was rejected."""
        self.advance(now)
        if isinstance(frame, NoFrame) or self._rooms.sight is None:
            if isinstance(frame, NoFrame):
                self._ledger.drop(frame.reason)
                if self._rooms.sight is not None:
                    self._rooms.sight.on_refused_frame(frame.reason, now)
            return
        self._rooms.sight.on_frame(frame, now)
        self._take_ready(now)

    def on_board(self, board: BoardReport, now: HostNs) -> None:
        """Handle a report of the board's load; it is sent to ground stations once an autopilot is adopted."""
        self.advance(now)
        self._rooms.board = board
        identity = self._rooms.identity
        if identity.autopilot is not None:
            fields = onboard_computer_status(board, now)
            self._outlet.messages.append(
                Outgoing(
                    name="ONBOARD_COMPUTER_STATUS",
                    fields=fields,
                    to=Destination.GROUND,
                    component=identity.companion_component,
                )
            )

    def on_internal_fault(self, now: HostNs) -> None:
        """Stop our heartbeats for a while after an internal fault: our messages may be wrong."""
        self._rooms.identity.fault()
        self._due_is_known = False
        self._fault_over_ns = HostNs(now + FAULT_SILENCE_NS)

    # Time.

    @property
    def wake_at(self) -> HostNs | None:
        """Instant at which :meth:`advance` has work; None: not before the next event. Computed once an event."""
        if not self._due_is_known:
            self._due_ns = min((due for due in self._dues() if due is not None), default=None)
            self._due_is_known = True
        return self._due_ns

    def advance(self, now: HostNs) -> None:
        """Do all that was due until now, in order and at its own time."""
        if self._clock_line_ns is None:
            self._clock_line_ns = self._next_whole_second(now)
            if self._live:
                self._speak(now)
            self._due_is_known = False
        while (due := self.wake_at) is not None and due <= now:
            self._wake(due, now)
            self._due_is_known = False
        self._due_is_known = False  # the coming event changes it

    def finish(self, now: HostNs) -> None:
        """End the flight: settle every frame and write the summary."""
        if self._ended:
            return
        self._ended = True
        self.advance(now)
        if self._rooms.sight is not None:
            self._ledger.settle(self._rooms.sight.finish(now), self._rooms.telemetry.world.plane)
        world = self._rooms.telemetry.world
        self._ledger.begin(world.plane.origin if world.plane else None)
        self._ledger.write(self._ledger.summary())

    def on_refused(self, reason: Reason, count: int, now: HostNs) -> None:
        """Count recorded frames that were refused before the pipeline."""
        self.advance(now)
        self._ledger.drop(reason, count)

    def header(self) -> Line | None:
        """First line of a targets file that begins now; None before the origin is decided."""
        return self._ledger.header()

    def summary(self) -> Line:
        """Last line of a targets file that ends now: counts since the start."""
        return self._ledger.summary()

    def assumed_arrival(self, frame: Frame) -> HostNs | None:
        """Assumed arrival time of a recorded frame without ``received_unix``; None while the clock is unknown."""
        return None if self._rooms.sight is None else self._rooms.sight.assumed_arrival(frame)

    # What goes out.

    @property
    def calibration_to_keep(self) -> KeptCalibration | None:
        """Result of self-calibration with which the next flight may begin; None without one."""
        report = None if self._rooms.sight is None else self._rooms.sight.calibration
        return None if report is None else report.keep

    @property
    def system(self) -> int:
        """Our MAVLink system id."""
        return self._rooms.identity.system

    @property
    def own_streams(self) -> OwnStreams:
        """The messages that we ask of the autopilot."""
        return self._rooms.rates.own_streams

    @property
    def telemetry(self) -> Telemetry:
        """Telemetry of the vehicle."""
        return self._rooms.telemetry

    @property
    def armed(self) -> bool:
        """Whether the adopted autopilot is armed."""
        autopilot = self._rooms.identity.autopilot
        return autopilot is not None and autopilot.armed

    @property
    def has_outputs(self) -> bool:
        """Whether :meth:`take` would return anything; after most messages it would not."""
        return self._outlet.has_outputs

    def take(self) -> Outputs:
        """All outputs since the last call."""
        return self._outlet.take()

    def status(self, now: HostNs) -> dict[str, Any]:
        """Part of the status file."""
        return {**self._rooms.status(now), **self._ledger.counts()}

    # Steps.

    def _dues(self) -> tuple[HostNs | None, ...]:
        rooms = self._rooms
        sight_due = rooms.sight.wake_at if rooms.sight is not None else None
        always = (self._clock_line_ns, self._fault_over_ns, rooms.identity.wake_at, rooms.telemetry.wake_at, sight_due)
        if not self._live:
            return always
        live = (rooms.timesync.wake_at, rooms.rates.wake_at, rooms.publisher.wake_at, self._consequences.wake_at)
        return always + live

    def _wake(self, due: HostNs, now: HostNs) -> None:
        """Let every room do what is due: estimation at the time it was due, messages at the present time."""
        rooms = self._rooms
        self._consequences.of_identity(rooms.identity.on_wake(due), now)
        self._consequences.of_telemetry(rooms.telemetry.on_wake(due), due)
        self._take_ready(due)
        self._settle(due)
        if self._clock_line_ns is not None and due >= self._clock_line_ns:
            self._write_each_second(self._clock_line_ns)
            self._clock_line_ns = self._next_whole_second(due)
        if self._fault_over_ns is not None and due >= self._fault_over_ns:
            self._fault_over_ns = None
            rooms.identity.fault_over()
        if self._live:
            self._speak(now)

    def _speak(self, now: HostNs) -> None:
        rooms, messages = self._rooms, self._outlet.messages
        healthy = rooms.identity.autopilot is not None and not rooms.identity.autopilot_lost
        messages += rooms.identity.heartbeats(now, healthy)
        request = rooms.timesync.on_wake(now)
        if request is not None:
            messages.append(request)
        if rooms.rates.wake_at is not None and rooms.rates.wake_at <= now:
            messages += rooms.rates.on_wake(now)
            self._outlet.notify(rooms.rates.notices(), now)
        if rooms.publisher.wake_at is not None and rooms.publisher.wake_at <= now:
            messages += rooms.publisher.on_wake(now, rooms.situation(now))
            self._outlet.notify(rooms.publisher.notices(), now)
        if self._consequences.wake_at is not None and self._consequences.wake_at <= now:
            self._consequences.on_wake(now)

    def _take_ready(self, now: HostNs) -> None:
        """Localize, track and publish the frames whose attitudes are there."""
        if self._rooms.sight is None:
            return
        for seen in self._rooms.sight.take_ready(now):
            if self._live:
                situation = self._rooms.situation(now, seen)
                publisher, parameters = self._rooms.publisher, self._rooms.rates.parameters
                publisher.landing.lag_s = parameters.get("PLND_LAG", publisher.landing.lag_s)
                self._outlet.messages += publisher.on_tracks(seen.tracks, situation, seen.pixel_from_ned)
                self._outlet.notify(publisher.notices(), now)

    def _settle(self, now: HostNs) -> None:
        if self._rooms.sight is not None:
            self._ledger.settle(self._rooms.sight.settle(now), self._rooms.telemetry.world.plane)

    def _write_each_second(self, at: HostNs) -> None:
        rooms = self._rooms
        clock_line = rooms.clock_line(at, self._unix_offset_ns)
        if clock_line is not None:
            self._ledger.write(clock_line)
        report = rooms.sight.calibration if rooms.sight is not None else None
        if rooms.sight is not None and report is not None:
            self._ledger.write(rooms.sight.calibration_news.line(report, unix_seconds(at, self._unix_offset_ns)))
            self._outlet.notify(rooms.sight.calibration_news.notices(report), at)

    def _next_whole_second(self, now: HostNs) -> HostNs:
        """The next whole second of the recording's clock: a replay then writes its lines at the same instants."""
        return HostNs(now + NS_PER_S - (now + self._unix_offset_ns) % NS_PER_S)
