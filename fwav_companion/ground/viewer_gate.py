"""SHELL: limits the connections to the viewers' server, which takes any number, waits for each without end, and does
not stop while one has sent no request.

A thread with a loop of its own passes whole requests on to the server, and its messages back.
"""

from __future__ import annotations

import asyncio
import socket
import threading
from contextlib import suppress
from typing import Final

MOST_VIEWERS: Final = 16
"""Most viewers; a further one is refused."""
MOST_WAITING: Final = 64
"""Most connections without a request so far: the oldest is closed for a newer one."""
REQUEST_S: Final = 10.0
"""Longest time from a connection to its whole request, seconds."""
SLOW_S: Final = 20.0
"""Longest time for which a viewer may take nothing, seconds; a slower one is disconnected."""
HEAD_BYTES: Final = 16_384
READ_BYTES: Final = 65_536
STOP_S: Final = 2.0


class ViewerGate:
    """Listens for viewers in place of a server on loopback."""

    def __init__(self, host: str, port: int) -> None:
        """Take the address. OSError where it cannot be used."""
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._socket = socket.create_server((host, port), family=family)
        self._server_port = 0
        self._waiting: dict[asyncio.StreamWriter, None] = {}
        """Connections without a request so far, the oldest first."""
        self._viewers = 0
        self._listener: asyncio.Server | None = None
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="viewers", daemon=True)

    def start(self, server_port: int) -> None:
        """Let viewers in. ``server_port``: the server's port on loopback."""
        self._server_port = server_port
        self._thread.start()
        listening = asyncio.start_server(self._serve, sock=self._socket, limit=HEAD_BYTES)
        self._listener = asyncio.run_coroutine_threadsafe(listening, self._loop).result(STOP_S)

    def close(self) -> None:
        """End every connection."""
        if self._thread.is_alive():
            asyncio.run_coroutine_threadsafe(self._end(), self._loop)
            self._thread.join(STOP_S)
        self._socket.close()
        if not self._loop.is_running():
            self._loop.close()

    async def _end(self) -> None:
        if self._listener is not None:
            self._listener.close()
        tasks = asyncio.all_tasks() - {asyncio.current_task()}
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        self._loop.stop()

    async def _serve(self, viewer_in: asyncio.StreamReader, viewer_out: asyncio.StreamWriter) -> None:
        """Serve one connection to its end."""
        # A cancelled handler of a stream would be an error in asyncio's log.
        with suppress(OSError, asyncio.CancelledError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            try:
                head = await self._request(viewer_in, viewer_out)
                if self._viewers < MOST_VIEWERS:
                    await self._relay(head, viewer_in, viewer_out)
            finally:
                viewer_out.transport.abort()
                await viewer_out.wait_closed()

    async def _request(self, viewer_in: asyncio.StreamReader, viewer_out: asyncio.StreamWriter) -> bytes:
        if len(self._waiting) >= MOST_WAITING:
            oldest = next(iter(self._waiting))
            del self._waiting[oldest]
            oldest.transport.abort()
        self._waiting[viewer_out] = None
        try:
            async with asyncio.timeout(REQUEST_S):
                return await viewer_in.readuntil(b"\r\n\r\n")
        finally:
            self._waiting.pop(viewer_out, None)

    async def _relay(self, head: bytes, viewer_in: asyncio.StreamReader, viewer_out: asyncio.StreamWriter) -> None:
        self._viewers += 1
        try:
            server_in, server_out = await asyncio.open_connection("127.0.0.1", self._server_port)
            try:
                server_out.write(head)
                ways = (_pumped(viewer_in, server_out), _pumped(server_in, viewer_out))
                tasks = [asyncio.ensure_future(way) for way in ways]
                await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
            finally:
                server_out.transport.abort()
                with suppress(OSError):
                    await server_out.wait_closed()
        finally:
            self._viewers -= 1


async def _pumped(source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
    """Pass bytes on until either end closes, or takes nothing for SLOW_S."""
    while data := await source.read(READ_BYTES):
        sink.write(data)
        async with asyncio.timeout(SLOW_S):
            await sink.drain()
