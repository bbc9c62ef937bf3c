"""SHELL: what the daemon says in the log: how its parts are doing, and what its pipeline finds."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping

from fwav_companion.config import Config
from fwav_companion.types import Notice, Severity
from fwav_companion.vision.wall_clock import ClockStep

log = logging.getLogger("fwav_companion")

_LEVELS = {
    Severity.INFO: logging.INFO,
    Severity.NOTICE: logging.INFO,
    Severity.WARNING: logging.WARNING,
    Severity.ERROR: logging.ERROR,
}


class ServiceLog:
    """Of one run; what the status file repeats is kept."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self.faults = 0
        """Mistakes of our own so far."""
        self.deaf_because = ""
        """Why detections cannot be taken; "" while they can."""

    def started(self, *, hears_detections: bool) -> None:
        """Where an autopilot and detections are waited for."""
        urls = [f"{link.name} ({link.url})" for link in self._config.link if link.role == "autopilot"]
        detections = f", and for detections on {self._config.detections.url}" if hears_detections else ""
        log.info("waiting for an autopilot on %s", " or ".join(urls) + detections)

    def stopped(self) -> None:
        """The last word."""
        log.info("stopped")

    def noticed(self, notices: Iterable[Notice]) -> None:
        """What the pipeline finds worth a line."""
        for notice in notices:
            log.log(_LEVELS[notice.severity], "%s", notice.text, extra={"code": notice.code.value})

    def link_changed(self, name: str, up: bool, why: str) -> None:
        """A link came up, or went."""
        if up:
            log.info("link %s is up", name)
        else:
            log.warning("link %s is down: %s; trying again", name, why)

    def detections_heard(self, listens: bool, why: str) -> None:
        """The socket of the detections is open, or cannot be opened."""
        self.deaf_because = why
        if not listens:
            log.warning("detections cannot be taken on %s: %s; trying again", self._config.detections.url, why)

    def pictures_seen(self, works: bool, why: str) -> None:
        """The vision process looks at pictures, or cannot."""
        source = self._config.vision.source if self._config.vision is not None else ""
        if works:
            log.info("looking at pictures of %s", source)
        else:
            log.warning("no pictures of %s: %s; trying again", source, why)

    def clock_stepped(self, step: ClockStep) -> None:
        """Somebody set the wall clock."""
        log.warning("the wall clock was set by %+.3f s; nothing here hangs on it", step.size_s)

    def faulted(self, context: Mapping[str, object]) -> None:
        """A mistake of ours, as the event loop tells it: whole once, then in a line."""
        self.faults += 1
        error = context.get("exception")
        trace = error if isinstance(error, BaseException) and self.faults == 1 else None
        log.error("internal fault %d: %s %r", self.faults, context.get("message"), error, exc_info=trace)


def warn(text: str) -> None:
    """From whatever thread."""
    log.warning("%s", text)
