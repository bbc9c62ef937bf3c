"""SHELL: moves bytes and frames between the links, the pipeline and the recording, and sets the timer."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Sequence

from fwav_companion.fair_queues import Origin
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.links.fair_frame_queue import HELD
from fwav_companion.links.reconnect import make_link
from fwav_companion.mavlink.router.node import PassedRequest, Received
from fwav_companion.service.camera_desk import CameraDesk
from fwav_companion.service.network import Outbox
from fwav_companion.service.parts import ServiceParts
from fwav_companion.service.service_factory import make_map_link
from fwav_companion.service.timer import FALLBACK_INTERVAL_NS, PipelineTimer
from fwav_companion.service.witness import Witness
from fwav_companion.types import Frame, NoFrame, Notice, NoticeCode, Outgoing
from fwav_companion.vision.frame_receiver import FrameReceiver

SMALL_BYTES = 2048
"""Size of a read that costs a tenth of a millisecond at most: the autopilot's links need not be read before it."""


class Dispatcher:
    """Passes received bytes and frames to the node and the pipeline, and sends, records and logs their outputs."""

    def __init__(self, parts: ServiceParts) -> None:
        self._log = parts.log
        self._clock = parts.clock
        self._pipeline = parts.pipeline
        self._signing = parts.signing
        self._node = parts.node
        self._journal = parts.journal
        self._arrivals = parts.arrivals
        self.links = {
            link.name: make_link(
                link.name, link.parsed_url, self.on_bytes, self._on_link_state, on_refused=self._log.peer_refused
            )
            for link in parts.config.link
        }
        self._first = [self.links[link.name] for link in parts.config.link if link.role == "autopilot"]
        self.map_link = make_map_link(parts.config, self._on_link_state)
        self._outbox = Outbox(
            self._node, self.links, map_link=self.map_link, journal=self._journal, on_fault=self._on_fault
        )
        self.receiver = FrameReceiver(
            self._on_frame,
            self._log.clock_stepped,
            self._clock.wall,
            self._clock.read,
            backlog=lambda: self._pipeline.waiting_detections,
        )
        self._frame_queue = self.receiver.queue
        self.camera = CameraDesk(self._pipeline, self._clock, self._journal, self.flush)
        self._alarm = PipelineTimer(self.on_alarm)
        self.witness: Witness | None = None
        """Observer of received frames and messages."""
        self.on_misconfigured: Callable[[], None] | None = None
        """Ends a run whose configuration the first messages contradict; None: it goes on."""

    # What comes in.

    def on_bytes(self, link: str, data: bytes) -> bool:
        """Process the bytes of one read of a link; returns whether they subscribe their sender to the link."""
        if len(data) > SMALL_BYTES:
            self._poll_autopilots(link)
        now = self._clock.now()
        source = self.links[link].source
        received = self._node.receive(link, data, now, source)
        self._take(received, now, origin=(link, source))
        return received.subscribes

    def _poll_autopilots(self, link: str) -> None:
        """Read the autopilot's links before many bytes of another link are processed."""
        if all(first.name != link for first in self._first):
            for first in self._first:
                first.poll()

    def _take(self, received: Received, now: HostNs, *, origin: Origin = HELD) -> None:
        followed = self._follow(received.rate_requests, now) if received.rate_requests else ()
        self._outbox.forward(received.forwards, followed, now, origin=origin)
        self._journal.received(received.frames, now)
        if not received.messages and not received.rate_requests:
            if self._node.wake_at is not None:  # an incomplete frame waits, and may get no further byte
                self._arm(now)
            return
        self._heard(now)
        waiting = self._pipeline.waiting_detections
        began_s = time.thread_time() if waiting else 0.0
        for message in received.messages:
            if self.witness is not None:
                self.witness.on_message(message)
            self._pipeline.on_message(message, now)
            if message.signed:
                self._signing.on_message(message, self._pipeline.identity.autopilot_address, now)
        if waiting:
            self._frame_queue.spent(time.thread_time() - began_s, waiting - self._pipeline.waiting_detections)
        self.flush(now)

    def _follow(self, passed: Sequence[PassedRequest], now: HostNs) -> Sequence[Outgoing]:
        """Requests of the service that follow stations' requests for message rates, in the same write."""
        return self._pipeline.on_rate_requests(passed, self._node.demanded, now)

    def _on_frame(self, frame: Frame | NoFrame) -> None:
        now = frame.arrival_ns if isinstance(frame, Frame) and frame.arrival_ns is not None else self._clock.now()
        self._arrivals.add(now)
        self._journal.frame(frame, now)
        self._heard(now)
        if self.witness is not None:
            self.witness.on_frame(frame)
        waiting, began_s = self._pipeline.waiting_detections, time.thread_time()
        self._pipeline.on_frame(frame, now)
        if isinstance(frame, Frame):
            processed = waiting + len(frame.detections) - self._pipeline.waiting_detections
            self._frame_queue.spent(time.thread_time() - began_s, processed)
        self.flush(now)

    def _heard(self, now: HostNs) -> None:
        """Do and send all due work before the event's own work: a TIMESYNC must not wait for it."""
        self._alarm.heard(now)
        due = self._pipeline.wake_at
        if due is not None and due <= now:
            self._pipeline.advance(now)
            self.flush(now)

    def on_alarm(self) -> None:
        """Do all work that is due, and set the timer again."""
        now = self._clock.now()
        if self._alarm.is_early(now, self._pipeline.wake_at, self._node.wake_at):
            self._arm(now)
            return
        if self._node.wake_at is not None:
            self._take(self._node.on_wake(now), now)
        self._pipeline.advance(now)
        self.flush(now)

    def report(self, notices: Sequence[Notice], now: HostNs) -> None:
        """Report the notices of a part of the service."""
        if notices:
            self._pipeline.on_notices(notices, now)
            self.flush(now)

    # What goes out.

    def flush(self, now: HostNs) -> None:
        """Send, record and log the pipeline's outputs."""
        if self._pipeline.has_outputs:  # most messages make none
            outputs = self._pipeline.take()
            identity = self._pipeline.identity
            self._node.adopt(identity.system, identity.autopilot_component, vehicle=identity.vehicle)
            self._node.share(self._pipeline.own_streams)
            self._outbox.send(outputs.messages, outputs.datagrams, now)
            self._journal.found(outputs.lines, now)
            self._log.noticed(outputs.notices)
            if any(notice.code is NoticeCode.STARTED_ANEW for notice in outputs.notices):
                self.camera.restart()
            if self.on_misconfigured and any(each.code is NoticeCode.ACT_MISCONFIGURED for each in outputs.notices):
                self.on_misconfigured()
            self.camera.send(outputs.spot_messages)
        if self._journal.records:
            self._journal.armed(self._pipeline.identity.armed, now)
        self._arm(now)

    def _arm(self, now: HostNs) -> None:
        self._alarm.arm(now, self._pipeline.wake_at, self._node.wake_at)

    # State of the parts.

    def _on_link_state(self, name: str, up: bool, why: str) -> None:
        self._log.link_changed(name, up, why)
        if name in self.links:
            (self._node.link_up if up else self._node.link_down)(name)

    def _on_fault(self, message: str, error: Exception) -> None:
        self.on_internal_fault(asyncio.get_running_loop(), {"message": message, "exception": error})

    def on_internal_fault(self, _loop: asyncio.AbstractEventLoop, context: dict[str, object]) -> None:
        """Log an internal fault, stop the heartbeats for a while as MAVLink demands, and go on.

        The interrupted work may still be due, and has set no timer. It is not repeated at once: that would not end.
        """
        now = self._clock.now()
        self._log.faulted(context)
        self._pipeline.on_internal_fault(now)
        self._alarm.arm(now, HostNs(now + FALLBACK_INTERVAL_NS))
