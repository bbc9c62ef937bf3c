"""SHELL: the daemon's work of once a second: watchdog, board, reports, stores, and the status file."""

from __future__ import annotations

import asyncio

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.links.url import SerialUrl
from fwav_companion.service.board import BoardWatch, wall_clock_is_synchronised
from fwav_companion.service.dispatcher import Dispatcher
from fwav_companion.service.latest_file import LatestFile
from fwav_companion.service.lean import search_for_garbage
from fwav_companion.service.parts import ServiceParts
from fwav_companion.service.status import StatusReport, SystemdNotifier, encoded

INTERVAL_S = 1.0
BOARD_TICKS = 5
"""Interval of ONBOARD_COMPUTER_STATUS, in ticks."""


class Housekeeping:
    """Ticks once a second while the event loop runs."""

    def __init__(
        self,
        parts: ServiceParts,
        dispatcher: Dispatcher,
        status: StatusReport,
        status_file: LatestFile,
        *,
        notifier: SystemdNotifier,
        utc_leaves: bool,
    ) -> None:
        """``utc_leaves``: whether messages with UTC leave the board."""
        self._parts = parts
        self._dispatcher = dispatcher
        self._status = status
        self._status_file = status_file
        self._notifier = notifier
        self._utc_leaves = utc_leaves
        self._board = BoardWatch({link.name: isinstance(link.parsed_url, SerialUrl) for link in parts.config.link})
        self._ticks = 0

    def tick(self) -> None:
        """Ping the systemd watchdog and do the other work of once a second; then write the status file."""
        loop = asyncio.get_running_loop()
        loop.call_later(INTERVAL_S, self.tick)
        loop.call_soon(self._write_status)
        parts, now = self._parts, self._parts.clock.now()
        self._notifier.alive()
        parts.journal.tick(now)
        if self._ticks % BOARD_TICKS == 0:
            self._look_at_board(now)
        self._dispatcher.report([*parts.node.notices(now), *self._dispatcher.receiver.queue.notices(now)], now)
        self._ticks += 1
        parts.pipeline.stations_want(parts.node.demanded)
        self._tick_signing(now)
        parts.calibrations.tick(parts.pipeline.calibration_to_keep)

    def _write_status(self) -> None:
        """Queue the status. This comes last, because the writing thread waits until this thread has no more work."""
        self._status_file.write(encoded(self._status.at(self._parts.clock.now())))
        search_for_garbage(self._ticks)

    def _tick_signing(self, now: HostNs) -> None:
        """Keep the signing time, and report if it is ahead."""
        if self._parts.node.signing_clock is None:
            return
        read_ns, unix_ns = self._parts.clock.read()
        self._dispatcher.report(self._parts.signing.tick(read_ns, unix_ns), now)

    def _look_at_board(self, now: HostNs) -> None:
        """Report the board's load. The wall clock is read only if UTC leaves the board."""
        believed = self._utc_leaves and wall_clock_is_synchronised()
        read_ns, unix_ns = self._parts.clock.read()
        utc_minus_host_s = (unix_ns - read_ns) / NS_PER_S if believed else None
        links = {name: link.status() for name, link in self._dispatcher.links.items()}
        self._parts.pipeline.on_board(self._board.report(links, utc_minus_host_s, now), now)
        self._dispatcher.flush(now)
