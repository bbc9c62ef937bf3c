"""Saves memory in the daemon, and avoids needless garbage collection in the daemon and in replays.

A file of its own, because it runs before asyncio and hashlib are imported.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import cast

OPENSSL = ("ssl", "_hashlib")
"""Modules that load OpenSSL."""


def spare_memory() -> None:
    """Keep OpenSSL and pymavlink's module out of memory. Call before asyncio is imported, in the daemon alone.

    asyncio and hashlib work without OpenSSL, as on a Python that was built without it: this saves 6 MiB, and Python's
    own SHA-256 takes 0.2 us longer on a frame. A service with a TAK server calls :func:`allow_openssl` once it has read
    its configuration. Only tables of pymavlink are needed, and they have been read: later imports reuse the memory of
    its classes, so a relay has 28 MiB and not 32. Until :func:`leave_the_rest_alone` no garbage collection interrupts
    the imports, which saves 5 % of the start.
    """
    for name in OPENSSL:
        cast("dict[str, object]", sys.modules).setdefault(name, None)  # an import of it then fails
    if "pymavlink" in sys.modules:  # not a process of the daemon alone: another module uses it
        return
    gc.disable()
    from fwav_companion.mavlink.wire.definitions import forget_dialect

    forget_dialect()
    gc.collect()


def allow_openssl() -> None:
    """Let OpenSSL be imported, for a connection by TLS. Call before asyncio is imported, which looks for it then."""
    for name in OPENSSL:
        if name in sys.modules and cast("dict[str, object]", sys.modules)[name] is None:
            del sys.modules[name]


@contextmanager
def without_searches() -> Iterator[None]:
    """Pause garbage collection while a replay imports its modules and reads its recording, which are permanent. This
    saves 6 % of its start-up time.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


NEW_BEFORE_A_SEARCH = 50_000
"""Number of new containers that starts a garbage collection in the middle of the work. Ten targets make fewer between
two calls of :func:`search_for_garbage`. With Python's default of 700, a collection ran in every seventh frame. The
daemon makes almost no reference cycles."""


def leave_the_rest_alone() -> None:
    """Exclude all present objects from garbage collection. Call when everything permanent has been made.

    A full collection went through every module, 25 ms in flight; now it covers only later objects.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(NEW_BEFORE_A_SEARCH)
    gc.enable()


def search_for_garbage(second: int) -> None:
    """Collect garbage among new objects every 16 s, and among all every four minutes. Call it in a quiet moment.

    The limit of new containers is then not reached, so that no collection interrupts a frame. With ten targets one
    takes 4 ms, and hardly less if called every second: it mostly goes through objects that are in use anyway.
    """
    if second % 16 == 0:
        gc.collect(2 if second % 256 == 0 else 1)
