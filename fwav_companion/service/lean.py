"""Memory that the daemon need not carry, nor look through: on a small board both are worth a few lines."""

from __future__ import annotations

import gc
import sys
from typing import cast


def spare_memory() -> None:
    """To be called before asyncio is imported, in a process that is the daemon and nothing else.

    asyncio and hashlib are made to do without OpenSSL, as on a Python that was built without it: 6 MiB. We open no
    such connection, and Python's own SHA-256 takes 0.2 us longer on a frame. pymavlink's texts about enumerations are
    3 MiB; what is imported afterwards gets their place.
    """
    for name in ("ssl", "_hashlib"):
        cast("dict[str, object]", sys.modules).setdefault(name, None)  # an import of it then fails
    from fwav_companion.mavlink.wire.definitions import forget_descriptions

    forget_descriptions()


NEW_BEFORE_A_SEARCH = 20_000
"""Containers made and kept. By Python's 700 a search of half a millisecond came in every seventh frame of ten targets;
now one of a few comes every six seconds, and next to nothing of ours runs in circles."""


def leave_the_rest_alone() -> None:
    """To be called when all that stays has been made: garbage is no more looked for in it.

    A full search went through the tables of MAVLink and every module, 25 ms in the midst of a flight; now it goes
    through what came since.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(NEW_BEFORE_A_SEARCH)
