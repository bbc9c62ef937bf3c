"""SHELL: limits what browsers and strangers can keep open or write into the log, before any request is understood."""

from __future__ import annotations

import asyncio
import logging
import time
from collections import Counter
from collections.abc import Callable
from typing import Any, Final

from aiohttp import web

REQUEST_S: Final = 10.0
"""Longest time from a connection to its first whole request, seconds: a page sends it at once."""
MOST_WAITING: Final = 64
"""Most connections without a request so far: two for each page that may be open."""
SWEEP_S: Final = 0.25
LOG_INTERVAL_S: Final = 1.0
"""Least time between two lines about bad requests, seconds."""
LINE: Final = 120
"""Longest text of an error in the log."""


class WaitingConnections:
    """Closes connections that send no request that is answered: after REQUEST_S, and those beyond MOST_WAITING."""

    def __init__(self, server: web.Server, clock: Callable[[], float]) -> None:
        """``clock``: seconds that never go back."""
        self._server, self._clock = server, clock
        self._since_s: dict[Any, float] = {}
        """First sight of each open connection without an answered request so far."""
        self._requesting: set[Any] = set()
        """Open connections that have sent a request that was not refused."""

    def on_request(self, request: web.Request) -> None:
        """Note that a connection has sent a whole request that is not refused."""
        self._requesting.add(request.protocol)

    def sweep(self) -> None:
        """Close the connections that wait for too long, and beyond MOST_WAITING the newest of the hosts with most: a
        flood keeps no browser of another host out.
        """
        now_s = self._clock()
        opened = self._server.connections
        self._requesting.intersection_update(opened)
        waiting = [each for each in opened if each not in self._requesting]
        self._since_s = {each: self._since_s.get(each, now_s) for each in waiting}
        of_host, ranks = Counter[str](), dict[Any, int]()
        for each in sorted(waiting, key=self._since_s.__getitem__):
            host = _host(each)
            ranks[each] = of_host[host]
            of_host[host] += 1
        for place, each in enumerate(sorted(ranks, key=ranks.__getitem__)):
            if (place >= MOST_WAITING or now_s - self._since_s[each] > REQUEST_S) and each.transport is not None:
                each.transport.abort()

    async def keep_sweeping(self) -> None:
        """Sweep until cancelled."""
        while True:
            self.sweep()
            await asyncio.sleep(SWEEP_S)


def _host(connection: Any) -> str:
    """Address of the other end; "" where it has gone."""
    peer = None if connection.transport is None else connection.transport.get_extra_info("peername")
    return str(peer[0]) if peer else ""


class QuietLog(logging.LoggerAdapter[logging.Logger]):
    """Logs the errors of the HTTP library in one short line, at most one a second, with the number left out."""

    def __init__(self, logger: logging.Logger) -> None:
        super().__init__(logger, {})
        self._last_s = float("-inf")
        self._left_out = 0

    def log(self, level: int, msg: object, *args: object, **kwargs: Any) -> None:
        """Log one line without a traceback. The library's debug messages are dropped."""
        if level < logging.WARNING:
            return
        now_s = time.monotonic()
        if now_s - self._last_s < LOG_INTERVAL_S:
            self._left_out += 1
            return
        error = kwargs.get("exc_info")
        why = " ".join(str(error if isinstance(error, BaseException) else (str(msg) % args if args else msg)).split())
        more = f" ({self._left_out} more)" if self._left_out else ""
        self._last_s, self._left_out = now_s, 0
        self.logger.warning("ground: bad request: %s%s", why[:LINE], more)
