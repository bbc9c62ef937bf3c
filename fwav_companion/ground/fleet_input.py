"""SHELL: a fleet's bus as an input of the picture; publishes the fused picture to the bus and to maps."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

from fwav_companion.fleet.bus import BusPlace, FleetBus
from fwav_companion.ground.fleet_picture import FleetPicture
from fwav_companion.ground.picture import GroundPicture

CROWDED_S = 10.0
"""Time for which messages that were left out are shown, seconds."""
PAUSE_S = 0.008
"""Pause between two turns of a step, seconds: as long as a turn, so that a step takes half of one processor."""


class FleetInput:
    """Subscribes to one fleet and publishes the fused picture."""

    def __init__(self, place: BusPlace, picture: GroundPicture, *, clock: Callable[[], float]) -> None:
        self._picture, self._clock = picture, clock
        self._name = f"fleet {place.name}"
        self._goes_on: asyncio.TimerHandle | None = None
        self._fleet = FleetPicture(picture, time.thread_time)
        self._bus = FleetBus(place, self._on_state)
        self._bus.subscribe(self._on_message, self._on_alive, self._fleet.knows)
        self._works = False
        self._dropped = 0
        self._crowded_unix = 0.0

    def start(self) -> None:
        """Open the bus."""
        self._picture.on_source(self._name, works=False, text="opening")
        self._bus.start()

    def tick(self, now: float) -> None:
        """Fuse, and publish the result. A step that is not done goes on after a pause, in which the page is served."""
        if self._works:
            self._report_load(now)
        if self._goes_on is None:
            self._step(now)

    def _report_load(self, now: float) -> None:
        """Show that more messages come than can be handled, until CROWDED_S after the last one that was left out."""
        dropped = self._bus.dropped
        if dropped > self._dropped:
            self._dropped, self._crowded_unix = dropped, now
        crowded = now < self._crowded_unix + CROWDED_S
        text = f"more messages come than can be handled: {dropped} were left out" if crowded else "open"
        self._picture.on_source(self._name, works=not crowded, text=text)

    def _step(self, now: float) -> None:
        self._goes_on = None
        parts = self._fleet.step(now)
        if parts is not None:
            self._bus.publish("fused", parts)
        if self._fleet.is_stepping:
            self._goes_on = asyncio.get_running_loop().call_later(PAUSE_S, lambda: self._step(self._clock()))

    def close(self) -> None:
        """Leave the bus."""
        if self._goes_on is not None:
            self._goes_on.cancel()
        self._bus.close()

    def _on_message(self, vehicle: str, kind: str, data: bytes) -> None:
        self._fleet.on_message(vehicle, kind, data, self._clock())

    def _on_alive(self, vehicle: str, there: bool) -> None:
        self._fleet.on_alive(vehicle, there, self._clock())

    def _on_state(self, works: bool, why: str) -> None:
        self._works = works
        self._picture.on_source(self._name, works=works, text="open" if works else f"not open: {why}")
