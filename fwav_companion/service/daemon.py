"""SHELL: the daemon. It moves bytes between the links and the pipeline, and sets the timer."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Mapping, Sequence

from fwav_companion.camera import Calibration
from fwav_companion.config import Config
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.links.reconnect import make_link
from fwav_companion.links.url import SerialUrl
from fwav_companion.localization import ElevationTile
from fwav_companion.mavlink.router.node import PassedRequest, Received
from fwav_companion.pipeline.pipeline_factory import make_pipeline
from fwav_companion.service.board import BoardWatch, board_name, wall_clock_is_synchronised
from fwav_companion.service.calibration_store import CalibrationStore
from fwav_companion.service.camera_desk import CameraDesk
from fwav_companion.service.journal import Journal
from fwav_companion.service.latest_file import LatestFile, status_paths
from fwav_companion.service.lean import search_for_garbage
from fwav_companion.service.log import ServiceLog, warn
from fwav_companion.service.network import Outbox, make_node
from fwav_companion.service.service_factory import (
    make_detections,
    make_fleet,
    make_map_link,
    make_recorder,
    make_vision,
)
from fwav_companion.service.signing_store import SigningStore
from fwav_companion.service.status import StatusReport, SystemdNotifier, encoded
from fwav_companion.service.stop_signals import end_by
from fwav_companion.service.timer import NET_NS, HostClock, PipelineTimer
from fwav_companion.service.witness import Witness
from fwav_companion.types import Frame, NoFrame, Notice, Outgoing
from fwav_companion.types.status import RunStatus
from fwav_companion.vision.frame_receiver import FrameReceiver

FILE_STOP_S = 0.4
"""Time to close each file: four of them stay below the two seconds that a stop may take."""
STATUS_INTERVAL_S = 1.0
BOARD_TICKS = 5
"""Interval of ONBOARD_COMPUTER_STATUS, in status intervals."""
SMALL_BYTES = 2048
"""Bytes of one read that cost a tenth of a millisecond at most: the autopilot's links need not go first."""
WITNESS_INTERVAL_S = 0.2


class Service:
    """One run of the daemon."""

    def __init__(
        self,
        config: Config,
        calibration: Calibration | None,
        signing_key: bytes | None,
        *,
        elevation: Sequence[ElevationTile],
        beside_recording: Mapping[str, bytes],
        attitudes_kept_s: float | None = None,
    ) -> None:
        """``elevation``: the tiles of [ground] terrain.

        ``beside_recording``: files that are kept with a flight's recording, by name. ``attitudes_kept_s``: for a
        witness that reads the vehicle's attitudes afterwards.
        """
        self._config = config
        self._log = ServiceLog(config)
        self._clock = HostClock()
        self._calibrations = CalibrationStore(config, warn)
        self._kept = self._calibrations.kept()
        self._pipeline = make_pipeline(
            config,
            calibration,
            unix_offset_ns=self._clock.unix_offset_ns,
            live=True,
            elevation=elevation,
            kept=self._kept,
            unit=board_name(),
            attitudes_kept_s=attitudes_kept_s,
            written=bool(config.record.directory),
        )
        self._signing = SigningStore(config, warn, wall_clock_is_synchronised)
        self._node = make_node(config, signing_key, self._signing.starting_timestamp(self._clock.started_unix_ns))
        self._links = {
            link.name: make_link(
                link.name, link.parsed_url, self._on_bytes, self._on_link_state, on_refused=self._log.peer_refused
            )
            for link in config.link
        }
        self._first = [self._links[link.name] for link in config.link if link.role == "autopilot"]
        self._board = BoardWatch({link.name: isinstance(link.parsed_url, SerialUrl) for link in config.link})
        self._map_link = make_map_link(config, self._on_link_state)
        self._fleet = make_fleet(
            config, self._pipeline, now=self._clock.now, warn=warn, on_notice=self._on_fleet_notice
        )
        ears = FrameReceiver(
            self._on_frame,
            self._log.clock_stepped,
            self._clock.wall,
            self._clock.read,
            backlog=lambda: self._pipeline.waiting_detections,
        )
        self._frame_queue = ears.queue
        self._journal = Journal(make_recorder(config, beside_recording, self._pipeline, warn), self._clock)
        self._camera = CameraDesk(self._pipeline, self._clock, self._journal, self._flush)
        self._detections = self._vision = None
        if calibration is not None:
            self._detections = make_detections(config, ears, self._log.detections_heard)
            self._vision = make_vision(
                config, calibration.image_size, ears, on_state=self._log.pictures_seen, desk=self._camera
            )
            self._camera.vision = self._vision
        self._outbox = Outbox(
            self._node, self._links, map_link=self._map_link, journal=self._journal, on_fault=self._on_fault
        )
        self._status_file = LatestFile(status_paths(config.status_path), warn, outlives_us=False)
        self._status = StatusReport(
            config,
            self._clock,
            node=self._node,
            links=self._links,
            vision=self._vision,
            journal=self._journal,
            pipeline=self._pipeline,
            log=self._log,
        )
        self._notifier = SystemdNotifier()
        self._alarm = PipelineTimer(self._on_alarm)
        self._stop = asyncio.Event()
        self._ticks = 0
        self._witness: Witness | None = None

    async def run(self) -> None:
        """Run until SIGTERM, SIGINT or SIGHUP, then stop within two seconds."""
        loop = asyncio.get_running_loop()
        end_by(loop, self._stop.set)
        loop.set_exception_handler(self._on_internal_fault)
        self._start()
        await self._stop.wait()
        self._notifier.stopping()
        self._close()

    async def listen(self, seconds: float) -> RunStatus:
        """Run for this time and return the status of its end. For ``check``."""
        self._start()
        try:
            await asyncio.sleep(seconds)
            status = self._status.at(self._clock.now())
        finally:
            self._close()
        return status

    async def attend(self, witness: Witness) -> None:
        """Run until the witness has seen enough. For ``check --shake``."""
        self._witness = witness
        self._start()
        try:
            while not witness.enough(self._status.at(self._clock.now()), self._pipeline.telemetry):  # noqa: ASYNC110
                # The answer depends on the time as well: there is no event to wait for.
                await asyncio.sleep(WITNESS_INTERVAL_S)
        finally:
            self._close()

    # Coming up and going down.

    def _start(self) -> None:
        self._journal.start(self._kept)
        files = (self._status_file, self._signing, self._calibrations)
        for part in (*files, self._detections, self._vision, self._map_link, self._fleet, *self._links.values()):
            if part is not None:
                part.start()
        self._signing.begin(self._node.signing_clock, self._clock.now())
        self._log.started(hears_detections=self._detections is not None)
        self._notifier.ready()
        self._tick()
        self._on_alarm()

    def _close(self) -> None:
        now = self._clock.now()
        self._journal.tick(now)
        self._pipeline.finish(now)
        self._flush(now)
        self._journal.end(now)
        for part in (self._detections, self._vision, self._map_link, self._fleet, *self._links.values()):
            if part is not None:
                part.close()
        for file in (self._journal, self._status_file, self._signing, self._calibrations):
            file.close(FILE_STOP_S)
        self._notifier.close()
        self._log.stopped()

    # What comes in.

    def _on_bytes(self, link: str, data: bytes) -> bool:
        if len(data) > SMALL_BYTES:
            self._poll_autopilots(link)
        now = self._clock.now()
        received = self._node.receive(link, data, now)
        self._take(received, now)
        return received.subscribes

    def _poll_autopilots(self, link: str) -> None:
        """Read the autopilot's links before many bytes of another link are processed."""
        if all(first.name != link for first in self._first):
            for first in self._first:
                first.poll()

    def _take(self, received: Received, now: HostNs) -> None:
        followed = self._follow(received.rate_requests, now) if received.rate_requests else ()
        self._outbox.forward(received.forwards, followed, now)
        self._journal.received(received.frames, now)
        if not received.messages and not received.rate_requests:
            if self._node.wake_at is not None:  # an incomplete frame waits, and may get no further byte
                self._arm(now)
            return
        self._heard(now)
        waiting = self._pipeline.waiting_detections
        began_s = time.thread_time() if waiting else 0.0
        for message in received.messages:
            if self._witness is not None:
                self._witness.on_message(message)
            self._pipeline.on_message(message, now)
            if message.signed:
                self._signing.on_message(message, self._pipeline.identity.autopilot_address, now)
        if waiting:
            self._frame_queue.spent(time.thread_time() - began_s, waiting - self._pipeline.waiting_detections)
        self._flush(now)

    def _follow(self, passed: Sequence[PassedRequest], now: HostNs) -> Sequence[Outgoing]:
        """What we ask behind stations' requests for message rates: in the write that carries these."""
        return self._pipeline.on_rate_requests(passed, self._node.demanded, now)

    def _on_frame(self, frame: Frame | NoFrame) -> None:
        now = frame.arrival_ns if isinstance(frame, Frame) and frame.arrival_ns is not None else self._clock.now()
        self._status.frame_came(now)
        self._journal.frame(frame, now)
        self._heard(now)
        if self._witness is not None:
            self._witness.on_frame(frame)
        waiting, began_s = self._pipeline.waiting_detections, time.thread_time()
        self._pipeline.on_frame(frame, now)
        if isinstance(frame, Frame):
            processed = waiting + len(frame.detections) - self._pipeline.waiting_detections
            self._frame_queue.spent(time.thread_time() - began_s, processed)
        self._flush(now)

    def _heard(self, now: HostNs) -> None:
        """Do and send what is due before the event's own work: a TIMESYNC must not wait for it."""
        self._alarm.heard(now)
        due = self._pipeline.wake_at
        if due is not None and due <= now:
            self._pipeline.advance(now)
            self._flush(now)

    def _on_alarm(self) -> None:
        now = self._clock.now()
        if self._alarm.is_early(now, self._pipeline.wake_at, self._node.wake_at):
            self._arm(now)
            return
        if self._node.wake_at is not None:
            self._take(self._node.on_wake(now), now)
        self._pipeline.advance(now)
        self._flush(now)

    def _tick(self) -> None:
        """Ping the systemd watchdog and do what else is due once a second; then write the status file."""
        loop = asyncio.get_running_loop()
        loop.call_later(STATUS_INTERVAL_S, self._tick)
        loop.call_soon(self._write_status)
        now = self._clock.now()
        self._notifier.alive()
        self._journal.tick(now)
        if self._ticks % BOARD_TICKS == 0:
            self._look_at_board(now)
        self._report([*self._node.notices(now), *self._frame_queue.notices(now)], now)
        self._ticks += 1
        self._pipeline.stations_want(self._node.demanded)
        self._tick_signing(now)
        self._calibrations.tick(self._pipeline.calibration_to_keep)

    def _write_status(self) -> None:
        """Queue the status. Done last, since the thread that writes it waits until this one has no more work."""
        self._status_file.write(encoded(self._status.at(self._clock.now())))
        search_for_garbage(self._ticks)

    def _tick_signing(self, now: HostNs) -> None:
        """Keep the signing time, and report where it is ahead."""
        if self._node.signing_clock is None:
            return
        read_ns, unix_ns = self._clock.read()
        self._report(self._signing.tick(read_ns, unix_ns), now)

    def _report(self, notices: Sequence[Notice], now: HostNs) -> None:
        if notices:
            self._pipeline.on_notices(notices, now)
            self._flush(now)

    def _look_at_board(self, now: HostNs) -> None:
        """Report the board's load. The wall clock is read only where UTC leaves the board."""
        believed = (self._map_link is not None or self._fleet is not None) and wall_clock_is_synchronised()
        read_ns, unix_ns = self._clock.read()
        utc_minus_host_s = (unix_ns - read_ns) / NS_PER_S if believed else None
        links = {name: link.status() for name, link in self._links.items()}
        self._pipeline.on_board(self._board.report(links, utc_minus_host_s, now), now)
        self._flush(now)

    # What goes out.

    def _flush(self, now: HostNs) -> None:
        if self._pipeline.has_outputs:  # most messages make none
            outputs = self._pipeline.take()
            self._node.adopt(self._pipeline.identity.system, self._pipeline.identity.autopilot_component)
            self._node.share(self._pipeline.own_streams)
            self._outbox.send(outputs.messages, outputs.datagrams, now)
            self._journal.found(outputs.lines, now)
            self._log.noticed(outputs.notices)
            self._camera.send(outputs.spot_messages)
        if self._journal.records:
            self._journal.armed(self._pipeline.identity.armed, now)
        self._arm(now)

    def _arm(self, now: HostNs) -> None:
        self._alarm.arm(now, self._pipeline.wake_at, self._node.wake_at)

    # State of the parts.

    def _on_link_state(self, name: str, up: bool, why: str) -> None:
        self._log.link_changed(name, up, why)
        if name in self._links:
            (self._node.link_up if up else self._node.link_down)(name)

    def _on_fleet_notice(self, notice: Notice) -> None:
        self._report([notice], self._clock.now())

    def _on_fault(self, message: str, error: Exception) -> None:
        self._on_internal_fault(asyncio.get_running_loop(), {"message": message, "exception": error})

    def _on_internal_fault(self, _loop: asyncio.AbstractEventLoop, context: dict[str, object]) -> None:
        """Log an internal fault, stop the heartbeats for a while as MAVLink demands, and go on.

        The interrupted work may still be due, and has set no timer. It is not repeated at once: that would not end.
        """
        now = self._clock.now()
        self._log.faulted(context)
        self._pipeline.on_internal_fault(now)
        self._alarm.arm(now, HostNs(now + NET_NS))
