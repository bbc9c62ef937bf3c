"""Links that reconnect: open, wait for the loss, report it once, and retry with growing delays."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Awaitable, Callable

import msgspec

from fwav_companion.errors import LinkError
from fwav_companion.fair_queues import Origin
from fwav_companion.links.base import (
    Connection,
    Link,
    LinkReceiver,
    LinkState,
    OnBytes,
    OnRefused,
    OnState,
    Opener,
    Traffic,
)
from fwav_companion.links.url import LinkUrl, SerialUrl, UdpUrl
from fwav_companion.types.network_status import LinkReport

FIRST_DELAY_S = 0.25
"""First delay before a retry: a device that re-enumerates needs a few tenths of a second."""
LONGEST_DELAY_S = 3.0
"""Longest delay before a retry, and so until a returned peer is noticed. An attempt costs a system call or two."""
REFUSED_INTERVAL_S = 60.0
"""Interval between two reports of refused peers."""
STEADY_S = 5.0
"""Duration of a connection after which the delays start short again."""


def make_link(
    name: str, url: LinkUrl, on_bytes: OnBytes, on_state: OnState, *, on_refused: OnRefused = lambda _link, _peer: None
) -> Link:
    """A link of the kind that the URL names, not started yet."""
    return StayingConnected(name, _opener(url), on_bytes, on_state, on_refused=on_refused)


def _opener(url: LinkUrl) -> Opener:
    """The opener of the URL's kind, imported only when needed: a board without a serial link does not load pyserial."""
    if isinstance(url, UdpUrl):
        from fwav_companion.links.udp import UdpOpener

        return UdpOpener(url)
    if isinstance(url, SerialUrl):
        from fwav_companion.links.serial import SerialOpener

        return SerialOpener(url)
    from fwav_companion.links.tcp import tcp_opener

    return tcp_opener(url)


class StayingConnected:
    """A :class:`Link` over an :class:`Opener`'s connections, one after the other."""

    def __init__(
        self,
        name: str,
        opener: Opener,
        on_bytes: OnBytes,
        on_state: OnState,
        *,
        on_refused: OnRefused = lambda _link, _peer: None,
        sleep: Callable[[float], Awaitable[None]] = asyncio.sleep,
        longest_delay_s: float = LONGEST_DELAY_S,
    ) -> None:
        """``sleep`` waits the seconds between two attempts, ``longest_delay_s`` at most."""
        self._longest_delay_s = longest_delay_s
        self.name = name
        self.state = LinkState.IDLE
        self._opener = opener
        self._on_bytes = on_bytes
        self._on_state = on_state
        self._on_refused = on_refused
        self._refused_s = -REFUSED_INTERVAL_S
        self._sleep = sleep
        self._traffic = Traffic()
        self._connection: Connection | None = None
        self._task: asyncio.Task[None] | None = None
        self._why = ""
        self._times_up = 0

    def start(self) -> None:
        """Begin to connect. Called once, from a running loop."""
        self.state = LinkState.OPENING
        self._task = asyncio.get_running_loop().create_task(self._stay_connected(), name=f"link {self.name}")
        self._task.add_done_callback(_tell_fault)

    def send(self, data: bytes, *, origin: Origin | None = None) -> None:
        """Send whole frames now, or drop and count them. ``origin``: None for the service's own."""
        connection = self._connection
        if connection is None:
            self._traffic.dropped += 1
        else:
            connection.send(data, origin=origin)

    def poll(self) -> None:
        """Pass on a bounded part of the received bytes."""
        if self._connection is not None:
            self._connection.poll()

    def close(self) -> None:
        """Close the link permanently and at once; no callback follows."""
        self.state = LinkState.CLOSED
        if self._task is not None:
            self._task.cancel()
        self._opener.close()
        self._release()

    @property
    def source(self) -> str:
        """Host from which the bytes came that are being passed on; "" where the link has only one peer."""
        return self._traffic.source

    def status(self) -> LinkReport:
        """State, reason, counters, and the entries of the connection."""
        traffic = self._traffic
        return msgspec.structs.replace(
            LinkReport() if self._connection is None else self._connection.status(),
            state=str(self.state),
            why=self._why,
            times_up=self._times_up,
            bytes_in=traffic.bytes_in,
            bytes_out=traffic.bytes_out,
            dropped=traffic.dropped,
        )

    async def _stay_connected(self) -> None:
        delay_s = FIRST_DELAY_S
        while True:
            if await self._live_once() >= STEADY_S:
                delay_s = FIRST_DELAY_S
            await self._sleep(delay_s)
            delay_s = min(2.0 * delay_s, self._longest_delay_s)

    async def _live_once(self) -> float:
        """Open a connection and wait for its loss; returns its duration in seconds."""
        loop = asyncio.get_running_loop()
        end: asyncio.Future[str] = loop.create_future()
        try:
            self._connection = await self._opener.open(self._receiver(end))
        except (OSError, LinkError) as error:
            self._went_down(reason_of(error))
            return 0.0
        since = loop.time()
        self._came_up()
        self._went_down(await end)
        return loop.time() - since

    def _receiver(self, end: asyncio.Future[str]) -> LinkReceiver:
        def on_bytes(data: bytes) -> bool:
            self._traffic.bytes_in += len(data)
            return self._on_bytes(self.name, data)

        def on_lost(why: str) -> None:
            if not end.done():
                end.set_result(why)

        return LinkReceiver(on_bytes, on_lost, self._traffic, self._refused)

    def _refused(self, peer: str) -> None:
        now_s = asyncio.get_running_loop().time()
        if now_s - self._refused_s >= REFUSED_INTERVAL_S:
            self._refused_s = now_s
            self._on_refused(self.name, peer)

    def _came_up(self) -> None:
        self.state, self._why = LinkState.UP, ""
        self._times_up += 1
        self._on_state(self.name, True, "")

    def _went_down(self, why: str) -> None:
        """Report the loss unless the link was down already: one report per outage, regardless of later attempts."""
        self._release()
        was_down, self.state, self._why = self.state is LinkState.DOWN, LinkState.DOWN, why
        if not was_down:
            self._on_state(self.name, False, why)

    def _release(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()


def _tell_fault(task: asyncio.Task[None]) -> None:
    """Pass the task's exception to the loop's handler: only a defect in this program raises one."""
    if not task.cancelled() and (error := task.exception()) is not None:
        task.get_loop().call_exception_handler({"message": f"{task.get_name()} failed", "exception": error})


def reason_of(error: OSError | LinkError) -> str:
    """The error in words: "Connection refused", not its number."""
    if isinstance(error, OSError) and error.errno is not None and error.errno > 0:
        return os.strerror(error.errno)
    return str(error) or type(error).__name__
