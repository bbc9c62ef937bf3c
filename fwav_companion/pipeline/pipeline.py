"""The pipeline on one page: messages and frames in; messages, lines and notices out. Pure: the time is an argument.

``run`` drives it from sockets, ``replay`` from files, tests from simulated time. Before every event it does the work
that was due earlier, with the time at which it was due, so that the machine's load does not change the estimates.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.client.identity import Identity
from fwav_companion.mavlink.router.node import PassedRequest
from fwav_companion.mavlink.wire.rate_messages import OwnStreams
from fwav_companion.pipeline.camera_restart import CameraRestart
from fwav_companion.pipeline.components import Components
from fwav_companion.pipeline.event_handlers import EventHandlers
from fwav_companion.pipeline.frame_handlers import FrameHandlers
from fwav_companion.pipeline.output_buffer import OutputBuffer, Outputs
from fwav_companion.pipeline.second_lines import SecondLines
from fwav_companion.pipeline.speaker import Speaker
from fwav_companion.pipeline.target_log import TargetLog
from fwav_companion.publishing.ground_messages import onboard_computer_status
from fwav_companion.self_calibration import KeptCalibration
from fwav_companion.telemetry import GIMBAL_MESSAGES, Telemetry
from fwav_companion.tracking.filters.base import ReportedTarget
from fwav_companion.types import (
    Autopilot,
    BoardReport,
    Destination,
    Frame,
    Message,
    NoFrame,
    Notice,
    Outgoing,
    Reason,
    Situation,
    Track,
)
from fwav_companion.types.messages import ATTITUDE_MESSAGES
from fwav_companion.types.spots import SpotRefused, SpotViews
from fwav_companion.types.status import PipelineStatus
from fwav_companion.types.track_marks import TrackMarks
from fwav_companion.types.tracks import CommonErrors, FinalPlace

ANSWERED = frozenset({"COMMAND_LONG", "COMMAND_INT", "PING", "HEARTBEAT"})
"""Requests that are answered from any sender, and what keeps them."""
LONGEST_SILENCE_NS = 3600 * NS_PER_S
"""Longest time without an event through which clock lines are written. A longer one is a gap of a recording; it gets
no lines."""
FAULT_SILENCE_NS = 6 * NS_PER_S
"""Pause of the heartbeats after an internal fault, long enough for peers to notice: they allow five missed ones."""


class Pipeline:
    """Pipeline of one flight. Every ``now`` is a host instant in whole microseconds that never decreases."""

    def __init__(
        self, components: Components, target_log: TargetLog, *, unix_offset_ns: int, live: bool = True
    ) -> None:
        """``unix_offset_ns``: recording's clock minus host clock. ``live``: false in a replay: no message is sent."""
        self._components = components
        self._target_log = target_log
        self._live = live
        self._clock_line_ns: HostNs | None = None
        self._fault_over_ns: HostNs | None = None
        self._due_ns: HostNs | None = None
        self._due_is_known = False
        self._outputs = OutputBuffer(components, target_log, live=live)
        self._handlers = EventHandlers(components, target_log, self._outputs, unix_offset_ns=unix_offset_ns, live=live)
        self._frames = FrameHandlers(components, target_log, self._outputs, live=live)
        self._seconds = SecondLines(components, target_log, self._outputs, unix_offset_ns)
        self._speaker = Speaker(components, self._outputs, self._handlers)
        self._restart = CameraRestart(components, self._handlers, self._outputs)
        self._ended = False

    # What comes in.

    def on_message(self, message: Message, now: HostNs) -> None:
        """Handle a message from any sender."""
        self.advance(now)
        components = self._components
        autopilot = components.identity.autopilot
        if message.name in ATTITUDE_MESSAGES and autopilot is not None:
            self._on_attitude(message, autopilot, now)
            return
        self._handlers.of_identity(components.identity.on_message(message, now), now)
        if message.name == "TIMESYNC":
            self._handlers.of_timesync(message, now)
        components.rates.on_message(message, now)
        if message.name == "PARAM_VALUE":
            self._handlers.of_parameters()
        autopilot = components.identity.autopilot
        if autopilot and message.system == autopilot.system and message.name in GIMBAL_MESSAGES:
            events = components.telemetry.on_gimbal(message, autopilot.component, now, autopilot.kind)
            if components.camera is not None:  # a relay has no camera that a gimbal could carry
                self._handlers.of_telemetry(events, now)
            self._frames.take_ready(now)
        elif autopilot and message.system == autopilot.system and message.component == autopilot.component:
            if message.name != "DISTANCE_SENSOR" or not components.publisher.is_own_range(message, now):
                self._handlers.of_telemetry(components.telemetry.on_message(message, now), now)
            self._frames.take_ready(now)
        if self._live and message.name in ANSWERED:
            self._handlers.of_request(message, now)
        if self._live and components.acting is not None:
            components.acting.on_message(message, components.identity.autopilot, now)
            self._speaker.act(now)

    def _on_attitude(self, message: Message, autopilot: Autopilot, now: HostNs) -> None:
        """Handle an attitude. Most messages are attitudes, and most of them do not change what is due."""
        components = self._components
        components.rates.on_message(message, now)
        if message.system != autopilot.system or message.component != autopilot.component:
            return
        world = components.telemetry.world
        due_ns = world.wake_at
        events = components.telemetry.on_message(message, now)
        if events:
            self._handlers.of_telemetry(events, now)
        taken = self._frames.take_ready(now)
        self._due_is_known = not events and not taken and world.wake_at == due_ns

    def on_own_message(self, message: Message, now: HostNs) -> None:
        """Handle a recorded message that the service itself sent: its TIMESYNC requests and its ranges are read."""
        self.advance(now)
        self._components.publisher.on_own_message(message, now)
        if message.name == "TIMESYNC" and message.fields.tc1 == 0:
            self._components.timesync.on_sent(message.fields.ts1, now, message.foreign_bytes)
            self._components.telemetry.clock.on_request(now)

    def on_rate_requests(
        self, passed: Sequence[PassedRequest], demanded: Mapping[int, float], now: HostNs
    ) -> list[Outgoing]:
        """Handle requests for message rates that were forwarded; returns the service's messages for the same write.

        ``demanded``: highest rate that stations want, hertz by message id.
        """
        rates = self._components.rates
        for one in passed:
            if not one.merged:
                rates.on_rate_request_passed(one.request.requester, now)
        self._due_is_known = False
        return rates.on_merged_requests([one.request for one in passed if one.merged], demanded, now)

    def count_relayed(self, foreign_bytes: Callable[[], int]) -> None:
        """Weight exchanges by the bytes of other systems that are relayed beside them: ``foreign_bytes`` gives their
        number so far.
        """
        self._components.timesync.foreign_bytes = foreign_bytes

    def stations_want(self, demanded: Mapping[int, float]) -> None:
        """Set the highest rate that stations want, hertz by message id; it also changes when they fall silent."""
        self._components.rates.stations_want(demanded)

    def on_frame(self, frame: Frame | NoFrame, now: HostNs) -> None:
        """Handle a decoded frame (possibly without detections), or the reason why a datagram was rejected."""
        self.advance(now)
        self._frames.of_frame(frame, now)

    def spot_views(self, frame: Frame, now: HostNs) -> SpotViews:
        """Predicted views of the clicked spots in a picture that the camera process has just taken."""
        self.advance(now)
        return self._components.spot_views(frame)

    def track_marks(self, frame: Frame, now: HostNs) -> TrackMarks:
        """Pixels of the confirmed and coasting tracks in a picture of the preview."""
        self.advance(now)
        return self._components.track_marks(frame)

    def on_spot_refused(self, refused: SpotRefused, now: HostNs) -> None:
        """Handle the camera process's report that it cannot follow a clicked spot."""
        self.advance(now)
        self._outputs.notify(self._components.on_spot_refused(refused), now)

    def on_board(self, board: BoardReport, now: HostNs) -> None:
        """Handle a report of the board's load; it is sent to ground stations once an autopilot is adopted."""
        self.advance(now)
        self._components.board = board
        identity = self._components.identity
        if identity.autopilot is not None:
            fields = onboard_computer_status(board, now)
            self._outputs.messages.append(
                Outgoing(
                    name="ONBOARD_COMPUTER_STATUS",
                    fields=fields,
                    to=Destination.GROUND,
                    component=identity.companion_component,
                )
            )

    def on_notices(self, notices: Sequence[Notice], now: HostNs) -> None:
        """Handle notices of the links."""
        self._outputs.notify(notices, now)

    def on_internal_fault(self, now: HostNs) -> None:
        """Pause the heartbeats after an internal fault: the service's messages may be wrong. Where faults repeat,
        localization and tracking start anew.
        """
        self._components.identity.beats.fault()
        self._restart.on_fault(now)
        self._due_is_known = False
        self._fault_over_ns = HostNs(now + FAULT_SILENCE_NS)

    @property
    def wake_at(self) -> HostNs | None:
        """Instant at which :meth:`advance` has work; None: not before the next event. Computed once per event."""
        if not self._due_is_known:
            self._due_ns = min([due for due in self._dues() if due is not None], default=None)
            self._due_is_known = True
        return self._due_ns

    def advance(self, now: HostNs) -> None:
        """Do all work that was due until now, in order, each with the time at which it was due."""
        if self._clock_line_ns is None:
            self._clock_line_ns = self._seconds.next_after(now)
            if self._live:
                self._speaker.speak(now)
            self._due_is_known = False
        if now - self._clock_line_ns > LONGEST_SILENCE_NS:
            self._clock_line_ns = self._seconds.next_after(HostNs(now - NS_PER_S))
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
        self._frames.finish(now)
        world = self._components.telemetry.world
        self._target_log.begin(world.plane.origin if world.plane else None)
        self._target_log.write(self._target_log.summary())

    def on_refused(self, reason: Reason, count: int, now: HostNs) -> None:
        """Count recorded frames that were refused before the pipeline."""
        self.advance(now)
        self._target_log.drop_frames(reason, count)

    @property
    def target_log(self) -> TargetLog:
        """The log with the lines of the targets file, header and summary included."""
        return self._target_log

    @property
    def best_targets(self) -> Mapping[int, ReportedTarget]:
        """The targets of all live tracks, by id; studies read from them what limits the accuracy."""
        return self._frames.best_targets

    def final_places(self) -> dict[int, FinalPlace]:
        """Targets by the whole flight, by id; empty without a smoother that keeps it."""
        return self._frames.final_places()

    def assumed_arrival(self, frame: Frame) -> HostNs | None:
        """Assumed arrival time of a recorded frame without ``received_unix``; None while the clock is unknown."""
        return self._frames.assumed_arrival(frame)

    @property
    def time_offset_s(self) -> float:
        """Configured delay of the camera's stamps, seconds; 0 without a camera."""
        return self._frames.time_offset_s

    # What goes out.

    @property
    def waiting_detections(self) -> int:
        """Number of detections in frames that wait for attitudes."""
        return self._frames.waiting_detections

    @property
    def calibration_to_keep(self) -> KeptCalibration | None:
        """Result of self-calibration that the next flight may start from; None without one."""
        return self._frames.calibration_to_keep

    @property
    def identity(self) -> Identity:
        """The service's system id, and the adopted autopilot."""
        return self._components.identity

    @property
    def own_streams(self) -> OwnStreams:
        """The messages that the service requests from the autopilot."""
        return self._components.rates.own_streams

    @property
    def telemetry(self) -> Telemetry:
        """Telemetry of the vehicle."""
        return self._components.telemetry

    @property
    def has_outputs(self) -> bool:
        """Whether :meth:`take` would return anything; after most messages it would not."""
        return self._outputs.has_outputs

    def take(self) -> Outputs:
        """All outputs since the last call."""
        return self._outputs.take()

    def shared(self, now: HostNs) -> tuple[tuple[Track, ...], Situation, str | None]:
        """For other vehicles: the confirmed and coasting tracks, the vehicle, and why it is not ready (None: ready)."""
        return self._components.shared(now)

    def common_errors(self) -> Mapping[int, CommonErrors]:
        """Errors that targets share with others, by track; empty without a smoother."""
        return self._components.common_errors()

    def footprint(self, now: HostNs) -> tuple[tuple[float, float], ...]:
        """Corners of the camera's footprint on the ground, latitude and longitude, degrees; empty where unknown."""
        return self._components.footprint(now)

    def status(self, now: HostNs) -> PipelineStatus:
        """The pipeline's part of the status."""
        return self._components.status(now, self._target_log)

    # Steps.

    def _dues(self) -> tuple[HostNs | None, ...]:
        components = self._components
        always = (
            self._clock_line_ns,
            self._fault_over_ns,
            self._restart.wake_at,
            components.identity.wake_at,
            components.telemetry.wake_at,
            self._frames.wake_at,
        )
        if not self._live:
            return always
        return always + self._speaker.dues()

    def _wake(self, due: HostNs, now: HostNs) -> None:
        """Let every room do its due work: estimation with the time it was due, messages with the present time."""
        components = self._components
        self._restart.on_wake(due)
        self._handlers.of_identity(components.identity.on_wake(due), now)
        self._handlers.of_telemetry(components.telemetry.on_wake(due), due)
        self._frames.take_ready(due)
        self._frames.settle(due)
        if self._clock_line_ns is not None and due >= self._clock_line_ns:
            self._seconds.write(self._clock_line_ns)
            self._clock_line_ns = self._seconds.next_after(due)
        if self._fault_over_ns is not None and due >= self._fault_over_ns:
            self._fault_over_ns = None
            components.identity.beats.fault_over()
        if self._live:
            self._speaker.speak(now)
