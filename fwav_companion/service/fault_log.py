"""SHELL: the log of internal faults: one that every message repeats must not fill the disk."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping

log = logging.getLogger("fwav_companion")

FAULT_LINE_S = 1.0
"""Shortest time between two lines about internal faults."""


class FaultLog:
    """Counts internal faults, and logs the first with its trace, later ones in one line a second."""

    def __init__(self) -> None:
        self.count = 0
        """Number of internal faults so far."""
        self._logged_s = 0.0

    def faulted(self, context: Mapping[str, object]) -> None:
        """Log a fault. ``context``: that of the event loop's exception handler."""
        self.count += 1
        error, now_s = context.get("exception"), time.monotonic()
        if self.count > 1 and now_s - self._logged_s < FAULT_LINE_S:
            return
        self._logged_s = now_s
        trace = error if isinstance(error, BaseException) and self.count == 1 else None
        log.error("internal fault %d: %s %r", self.count, context.get("message"), error, exc_info=trace)
