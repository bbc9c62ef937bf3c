"""SHELL: the vehicles and targets as Cursor on Target, once a second, for ATAK and similar maps."""

from __future__ import annotations

from collections.abc import Callable

from fwav_companion.geoid import geoid_undulation_m
from fwav_companion.ground.exports import cot_events
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.links.map_link import make_map_link
from fwav_companion.links.map_server import MapServer

PERIOD_S = 1.0


class MapOutput:
    """Sends every vehicle that is heard, and every target, to one address."""

    def __init__(self, server: MapServer, picture: GroundPicture, utc_ns: Callable[[], int | None], unit: str) -> None:
        """``utc_ns``: UTC; None if it is unknown: then nothing is sent, which is reported."""
        self._picture, self._utc_ns, self._unit = picture, utc_ns, unit
        self._link, url = make_map_link(server, self._on_state)
        self._name = str(url)
        self._due_unix = 0.0
        self._up = False

    def start(self) -> None:
        """Open the link."""
        self._link.start()

    def tick(self, now: float) -> None:
        """Send the events that are due."""
        if now < self._due_unix:
            return
        self._due_unix = now + PERIOD_S
        utc_ns = self._utc_ns()
        if utc_ns is None:
            text = "Cursor on Target is not sent: synchronise this machine's clock (NTP)"
            self._picture.on_source(self._name, works=False, text=text)
            return
        if self._up:
            self._picture.on_source(self._name, works=True, text="Cursor on Target is sent")
            targets, vehicles = self._picture.targets.values(), self._picture.vehicles.values()
            for event in cot_events(
                targets, utc_ns, self._unit, vehicles=vehicles, geoid=geoid_undulation_m, now_unix=now
            ):
                self._link.send(event)

    def close(self) -> None:
        """Close the link."""
        self._link.close()

    def _on_state(self, _name: str, up: bool, why: str) -> None:
        self._up = up
        if not up:
            self._picture.on_source(self._name, works=False, text=f"not open: {why}")
