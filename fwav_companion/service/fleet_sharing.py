"""SHELL: shares this vehicle's tracks and state with others if [fleet] is configured."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Callable

import msgspec

from fwav_companion.config import Config
from fwav_companion.fleet.bus import BusPlace, FleetBus
from fwav_companion.fleet.fleet_tracks import FleetTracks
from fwav_companion.fleet.options import FleetTable
from fwav_companion.fleet.payloads import MAX_BYTES, encoded
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.pipeline.pipeline import Pipeline
from fwav_companion.types import Notice, NoticeCode, Severity, Situation

WITHOUT_UTC = "UTC is unknown: wait for the autopilot's GPS, or run NTP on this board"
WITHOUT_POSITION = "no position: wait for the autopilot's GPS, or its good local position"


class FleetSharing:
    """Publishes at the configured rate while the service runs."""

    def __init__(
        self,
        table: FleetTable,
        config: Config,
        pipeline: Pipeline,
        *,
        now: Callable[[], HostNs],
        warn: Callable[[str], None],
        on_notice: Callable[[Notice], None],
    ) -> None:
        """``warn``: writes a line to the log. ``on_notice``: receives notices for the ground. UserError by zenoh."""
        self._table, self._pipeline, self._now = table, pipeline, now
        self._warn, self._on_notice = warn, on_notice
        path = str(config.resolve(table.config)) if table.config else ""
        place = BusPlace(table.name, connect=table.connect, listen=table.listen, scouting=table.scouting, config=path)
        self._bus = FleetBus(place, self._on_state)
        self._tracks = FleetTracks(table, config.priors, secrets.token_hex(8))
        self._reported: set[NoticeCode] = set()
        self._reported_closed = False
        self._timer: asyncio.TimerHandle | None = None

    def start(self) -> None:
        """Open the bus and begin to publish."""
        self._bus.start()
        self._tick()

    def close(self) -> None:
        """Leave the fleet."""
        if self._timer is not None:
            self._timer.cancel()
        self._bus.close()

    def _tick(self) -> None:
        self._timer = asyncio.get_running_loop().call_later(1.0 / self._table.rate_hz, self._tick)
        now = self._now()
        tracks, situation, obstacle = self._pipeline.shared(now)
        messages = self._tracks.messages(tracks, situation, obstacle, self._pipeline.common_errors())
        if messages is None:
            self._report(situation)
            return
        message, state = messages
        state = msgspec.structs.replace(state, footprint=self._pipeline.footprint(now))
        self._bus.announce(message.vehicle)
        self._bus.publish(f"{message.vehicle}/tracks", encoded(message))
        if len(data := msgspec.json.encode(state)) <= MAX_BYTES:
            self._bus.publish(f"{message.vehicle}/state", [data])

    def _report(self, situation: Situation) -> None:
        """Report once why nothing is shared; before the autopilot is known there is nothing to report."""
        if situation.autopilot is None:
            return
        without_utc = situation.utc_minus_host_s is None
        code = NoticeCode.FLEET_WITHOUT_UTC if without_utc else NoticeCode.FLEET_WITHOUT_POSITION
        if code not in self._reported:
            self._reported.add(code)
            text = f"nothing is shared with the fleet: {WITHOUT_UTC if without_utc else WITHOUT_POSITION}"
            self._on_notice(Notice(code, Severity.WARNING, text, to_ground=True))

    def _on_state(self, works: bool, why: str) -> None:
        if not works:
            self._warn(f"[fleet] the bus does not open: {why}; trying again")
            self._reported_closed = True
        elif self._reported_closed:
            self._warn("[fleet] the bus is open")
