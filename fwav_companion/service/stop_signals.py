"""SHELL: makes the daemon end with exit status 0 on SIGTERM, SIGINT and SIGHUP at any time.

Before the service runs, there is nothing to close: the process ends at once. :func:`end_at_once` is called before any
other module is imported, so this one imports only ``os`` and ``signal``; annotations need no import.
"""

import os
import signal

STOP_SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)


def end_at_once() -> None:
    """Make these signals end the process at once."""
    _handle(lambda _number, _frame: os._exit(0))


def end_by(loop: "AbstractEventLoop", stop: "Callable[[], object]") -> None:
    """Make these signals call ``stop`` in the event loop.

    The handlers remain when the loop is closed, unlike those of ``loop.add_signal_handler``: a signal that arrives
    while the interpreter ends does not change the exit status.
    """
    _handle(lambda _number, _frame: None if loop.is_closed() else loop.call_soon_threadsafe(stop))


def _handle(handler: "Callable[[int, FrameType | None], object]") -> None:
    for number in STOP_SIGNALS:
        if number is signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN:  # nohup
            continue
        signal.signal(number, handler)


TYPE_CHECKING = False
if TYPE_CHECKING:
    from asyncio import AbstractEventLoop
    from collections.abc import Callable
    from types import FrameType
