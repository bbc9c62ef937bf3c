"""SHELL: the ground process: its inputs, one picture, and the page."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Callable, Sequence
from typing import Protocol

import msgspec

from fwav_companion import __version__
from fwav_companion.ground.access import AccessRules
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.server import PageServer, PageSettings
from fwav_companion.ground.tiles import TileFile
from fwav_companion.service.board import board_name, wall_clock_is_synchronised
from fwav_companion.service.fault_log import FaultLog

TICK_S = 0.1


class PictureInput(Protocol):
    """An input of the picture."""

    def start(self) -> None:
        """Begin; called once, from a running loop."""

    def tick(self, now: float) -> None:
        """Do what is due; called ten times a second."""

    def close(self) -> None:
        """Release the input."""


class PageAddress(msgspec.Struct, frozen=True, kw_only=True):
    """Where a page is served."""

    host: str
    port: int
    token: str
    """"" on loopback."""

    @property
    def shown(self) -> str:
        """The address to open in a browser."""
        name = socket.gethostname() if self.host in ("0.0.0.0", "::") else self.host  # noqa: S104
        shown = f"[{name}]" if ":" in name else name
        return f"http://{shown}:{self.port}/" + (f"?token={self.token}" if self.token else "")


class GroundOptions(PageAddress, frozen=True, kw_only=True):
    """Options of the ground picture from the command line."""

    rate_hz: float
    title: str = "ground picture"


def access_rules(address: PageAddress) -> AccessRules:
    """The access rules of a page; beyond loopback it is also served under this machine's names."""
    name = socket.gethostname().lower()
    names = ("localhost", name, f"{name}.local") if address.token else ()
    return AccessRules(host=address.host, port=address.port, token=address.token, names=names)


class GroundClock:
    """Unix seconds that never step: the wall clock of the start plus the monotonic clock since."""

    def __init__(self) -> None:
        self._offset_s = time.time() - time.monotonic()

    def now(self) -> float:
        """The present instant."""
        return time.monotonic() + self._offset_s


class GroundProcess:
    """The ground process with all its parts."""

    def __init__(
        self,
        picture: GroundPicture,
        inputs: Sequence[PictureInput],
        options: GroundOptions,
        *,
        clock: Callable[[], float],
        tiles: TileFile | None = None,
        replays: bool = False,
    ) -> None:
        """``clock``: time of the picture: that of this process, or of the replayed recording."""
        self._picture, self._inputs, self._clock, self._tiles = picture, inputs, clock, tiles
        self._faults = FaultLog()
        self._server = PageServer(
            picture,
            access_rules(options),
            PageSettings(
                version=__version__,
                title=options.title,
                tiles=None if tiles is None else tiles.info,
                replay=replays,
            ),
            clock=clock,
            rate_hz=options.rate_hz,
            tiles=tiles,
            utc_ns=utc_ns,
            unit=board_name(),
        )

    async def run(self, stop: asyncio.Event, ready: Callable[[], None]) -> None:
        """Serve until ``stop``. ``ready`` is called once the page can be opened. OSError where it cannot listen."""
        asyncio.get_running_loop().set_exception_handler(lambda _, context: self._faults.faulted(context))
        await self._server.start()
        try:
            for each in self._inputs:
                each.start()
            ready()
            while not stop.is_set():
                self._tick(self._clock())
                await _first_of(stop, TICK_S)
        finally:
            for each in self._inputs:
                each.close()
            await self._server.close()
            if self._tiles is not None:
                self._tiles.close()

    def _tick(self, now: float) -> None:
        """Let each input do what is due. An internal fault is logged and counted, and ends nothing."""
        for work in (*(each.tick for each in self._inputs), self._picture.advance):
            try:
                work(now)
            except Exception as error:  # noqa: BLE001 (none may end the page, whatever a stranger has sent)
                self._faults.faulted({"message": "of an input of the picture", "exception": error})


def utc_ns() -> int | None:
    """UTC by the wall clock; None where it is not synchronised."""
    return time.time_ns() if wall_clock_is_synchronised() else None


async def _first_of(stop: asyncio.Event, seconds: float) -> None:
    """Wait for the event, but not longer than this."""
    try:
        async with asyncio.timeout(seconds):
            await stop.wait()
    except TimeoutError:
        return
