"""SHELL: calls that may block (a serial open, a name look-up, a camera) kept off the loop, and off the exit.

The loop's default executor will not do: ``asyncio.run`` waits for it, and the interpreter joins its threads, so one
hanging call would hold up the two seconds of a clean stop. A daemon thread is simply left behind.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")
V = TypeVar("V")


def _nothing_to_undo(_result: object) -> None:
    """Most results need no undoing."""


async def in_daemon_thread(call: Callable[[], T], *, name: str, undo: Callable[[T], None] = _nothing_to_undo) -> T:
    """What ``call`` gives, or raises, from a thread of its own called ``name``.

    Cancelled, it returns at once; the thread goes on, and ``undo`` is called with a result that comes too late.
    The caller bounds how many calls it has under way.
    """
    handover = _Handover(call, undo)
    threading.Thread(target=handover.run, name=name, daemon=True).start()
    return await handover.result()


class _Handover(Generic[T]):
    """From one thread to the loop that waits for it, or does no longer."""

    def __init__(self, call: Callable[[], T], undo: Callable[[T], None]) -> None:
        self._call = call
        self._undo = undo
        self._loop = asyncio.get_running_loop()
        self._outcome: asyncio.Future[T] = self._loop.create_future()

    async def result(self) -> T:
        """On the loop: wait."""
        try:
            return await self._outcome
        except asyncio.CancelledError:
            if not self._outcome.cancelled() and self._outcome.exception() is None:
                self._undo(self._outcome.result())  # both came in one turn of the loop: nobody else sees the result
            raise

    def run(self) -> None:
        """In the thread: call, and hand over."""
        try:
            result = self._call()
        except Exception as error:  # noqa: BLE001  # raised again where it is waited for
            self._on_loop(self._fail, error)
        else:
            if not self._on_loop(self._succeed, result):
                self._undo(result)

    def _on_loop(self, callback: Callable[[V], None], value: V) -> bool:
        """Have the loop call back; False where it is closed already."""
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
