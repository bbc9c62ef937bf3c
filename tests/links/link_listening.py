"""A listener that tests of links can wait for, and a loop with a short time limit."""

import asyncio
import contextlib
from collections.abc import Callable, Coroutine, Iterator
from typing import Any

from fwav_companion.links.base import Link
from fwav_companion.links.reconnect import make_link
from fwav_companion.links.url import parse_link_url

PATIENCE_S = 20.0
"""For what takes milliseconds, on a machine that is busy with other things."""


class Listener:
    """Collects the callbacks of a link."""

    def __init__(self) -> None:
        self.data = b""
        self.chunks: list[bytes] = []
        self.states: list[tuple[bool, str]] = []
        self.valid: Callable[[bytes], bool] = lambda _data: True
        """Whether bytes hold a valid frame that subscribes its source."""
        self._changed = asyncio.Event()

    def on_bytes(self, _name: str, data: bytes) -> bool:
        self.data += data
        self.chunks.append(data)
        self._changed.set()
        return self.valid(data)

    def on_state(self, _name: str, up: bool, why: str) -> None:
        self.states.append((up, why))
        self._changed.set()

    async def until(self, condition: Callable[[], bool]) -> None:
        """Wait for callbacks until the condition holds."""
        async with asyncio.timeout(PATIENCE_S):
            while not condition():
                self._changed.clear()
                await self._changed.wait()

    async def until_up(self, times: int = 1) -> None:
        await self.until(lambda: sum(up for up, _ in self.states) >= times)

    async def until_down(self, times: int = 1) -> None:
        await self.until(lambda: sum(not up for up, _ in self.states) >= times)


@contextlib.contextmanager
def started(url: str, listener: Listener) -> Iterator[Link]:
    """The link of a URL, closed at the end."""
    link = make_link("a", parse_link_url(url), listener.on_bytes, listener.on_state)
    link.start()
    try:
        yield link
    finally:
        link.close()


async def until(condition: Callable[[], bool]) -> None:
    """Wait, iteration by iteration of the loop, for a condition that no callback signals."""
    async with asyncio.timeout(PATIENCE_S):
        while not condition():  # noqa: ASYNC110  # no event tells it
            await asyncio.sleep(0.005)


def run(story: Coroutine[Any, Any, None]) -> None:
    """Run a test's coroutine; an error in a callback fails it too."""
    errors: list[dict[str, Any]] = []

    async def watched() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _loop, context: errors.append(context))
        await story

    asyncio.run(watched())
    assert errors == []
