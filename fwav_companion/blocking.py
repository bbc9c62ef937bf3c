"""SHELL: runs calls that may block (a serial open, a name look-up, a camera) without blocking the loop or the exit.

The loop's default executor is unsuitable: ``asyncio.run`` waits for it, and the interpreter joins its threads, so that
one hanging call would delay a clean stop beyond its two seconds. A daemon thread is abandoned instead.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")
V = TypeVar("V")


def _nothing_to_undo(_result: object) -> None:
    """Do nothing: most results need no undoing."""


async def in_daemon_thread(call: Callable[[], T], *, name: str, undo: Callable[[T], None] = _nothing_to_undo) -> T:
    """The result or exception of ``call``, which runs in a thread of its own called ``name``.

    Cancellation takes effect at once; the thread continues, and ``undo`` is called with a result that comes too late.
    The caller bounds the number of its calls under way.
    """
    handover = _Handover(call, undo)
    threading.Thread(target=handover.run, name=name, daemon=True).start()
    return await handover.result()


class _Handover(Generic[T]):
    """Passes a result from one thread to the loop that waits for it, or has stopped waiting."""

    def __init__(self, call: Callable[[], T], undo: Callable[[T], None]) -> None:
        self._call = call
        self._undo = undo
        self._loop = asyncio.get_running_loop()
        self._outcome: asyncio.Future[T] = self._loop.create_future()

    async def result(self) -> T:
        """The result; awaited on the loop."""
        try:
            return await self._outcome
        except asyncio.CancelledError:
            if not self._outcome.cancelled() and self._outcome.exception() is None:
                self._undo(self._outcome.result())  # result and cancellation came in one turn of the loop
            raise

    def run(self) -> None:
        """Call, and pass the outcome to the loop; runs in the thread."""
        try:
            result = self._call()
        except Exception as error:  # noqa: BLE001  # raised again where it is waited for
            self._on_loop(self._fail, error)
        else:
            if not self._on_loop(self._succeed, result):
                self._undo(result)

    def _on_loop(self, callback: Callable[[V], None], value: V) -> bool:
        """Schedule the callback on the loop; False if the loop is closed."""
        try:
            self._loop.call_soon_threadsafe(callback, value)
        except RuntimeError:
            return False
        return True

    def _succeed(self, result: T) -> None:
        if self._outcome.done():
            self._undo(result)
        else:
            self._outcome.set_result(result)

    def _fail(self, error: Exception) -> None:
        if not self._outcome.done():
            self._outcome.set_exception(error)
