"""Makes SIGTERM and SIGHUP end a command like Ctrl-C, so that it removes its folders and processes."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = (signal.SIGTERM, signal.SIGHUP)
"""Signals of a service manager, and of a terminal that closes."""


@contextmanager
def as_by_ctrl_c() -> Iterator[None]:
    """A context in which these signals act as SIGINT does. An ignored signal (nohup) remains ignored."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    replaced = {number: handler for number, handler in before.items() if handler is not signal.SIG_IGN}
    for number in replaced:
        signal.signal(number, _interrupt)
    try:
        yield
    finally:
        for number, handler in replaced.items():
            signal.signal(number, handler)


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    """Raise SIGINT: an event loop then cancels its task, and other code sees a KeyboardInterrupt."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as in a process that a script starts with ``&``
        raise KeyboardInterrupt
    signal.raise_signal(signal.SIGINT)
