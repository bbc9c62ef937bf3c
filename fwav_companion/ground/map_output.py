"""SHELL: the targets as Cursor on Target, once a second, for ATAK and similar maps."""

from __future__ import annotations

from collections.abc import Callable

from fwav_companion.ground.exports import cot_events
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.links.reconnect import make_link
from fwav_companion.links.url import TcpUrl, UdpUrl

PERIOD_S = 1.0


class MapOutput:
    """Sends every target that has not ended to one address."""

    def __init__(
        self, url: UdpUrl | TcpUrl, picture: GroundPicture, utc_ns: Callable[[], int | None], unit: str
    ) -> None:
        """``utc_ns``: UTC; None if it is unknown: then nothing is sent, which is reported."""
        self._url, self._picture, self._utc_ns, self._unit = url, picture, utc_ns, unit
        self._link = make_link("cot", url, lambda _name, _data: False, self._on_state)
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
            self._picture.on_source(str(self._url), works=False, text=text)
            return
        if self._up:
            self._picture.on_source(str(self._url), works=True, text="Cursor on Target is sent")
            for event in cot_events(self._picture.targets.values(), utc_ns, self._unit):
                self._link.send(event)

    def close(self) -> None:
        """Close the link."""
        self._link.close()

    def _on_state(self, _name: str, up: bool, why: str) -> None:
        self._up = up
        if not up:
            self._picture.on_source(str(self._url), works=False, text=f"not open: {why}")
