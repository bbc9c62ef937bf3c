"""How a command ends that was told to, by whatever signal: with its folders and processes cleared away."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = (signal.SIGTERM, signal.SIGHUP)
"""Of a service manager, and of a terminal that closes."""


@contextmanager
def as_by_ctrl_c() -> Iterator[None]:
    """Inside, these signals end the command as SIGINT does. Who had one ignored (nohup) goes on ignoring it."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    heeded = {number: handler for number, handler in before.items() if handler is not signal.SIG_IGN}
    for number in heeded:
        signal.signal(number, _interrupt)
    try:
        yield
    finally:
        for number, handler in heeded.items():
            signal.signal(number, handler)


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    """As a real SIGINT: an event loop cancels what it runs, and all else sees a KeyboardInterrupt."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as a shell has it for what a script starts by ``&``
        raise KeyboardInterrupt
    signal.raise_signal(signal.SIGINT)
