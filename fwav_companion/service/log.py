"""SHELL: the daemon's log: state of its parts, and the notices of its pipeline."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from pathlib import Path

from fwav_companion.config import Config
from fwav_companion.service.fault_log import FaultLog
from fwav_companion.types import Notice, Severity
from fwav_companion.types.status import VisionReport
from fwav_companion.vision.task import shown_source
from fwav_companion.vision.wall_clock import ClockStep

log = logging.getLogger("fwav_companion")

_LEVELS = {
    Severity.INFO: logging.INFO,
    Severity.NOTICE: logging.INFO,
    Severity.WARNING: logging.WARNING,
    Severity.ERROR: logging.ERROR,
}


class ServiceLog:
    """Writes the log of one run, and keeps the counts and texts that the status file repeats."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._faults = FaultLog()
        self.deaf_because = ""
        """Why detections cannot be received; "" while they can."""

    def started(self, *, hears_detections: bool) -> None:
        """Log where the daemon waits for an autopilot and for detections."""
        urls = [f"{link.name} ({link.url})" for link in self._config.link if link.role == "autopilot"]
        detections = f", and for detections on {self._config.detections.url}" if hears_detections else ""
        log.info("waiting for an autopilot on %s", " or ".join(urls) + detections)

    def accompanied(self, other: tuple[int, Path] | None) -> None:
        """Log that another `run` is active, with its process id and status file: both claim the same inputs."""
        if other is not None:
            log.warning("another run is active (pid %d, status in %s): end one of the two", *other)

    def stopped(self) -> None:
        """Log the end of the run."""
        log.info("stopped")

    def noticed(self, notices: Iterable[Notice]) -> None:
        """Log the notices of the pipeline; each record carries the code of its notice."""
        for notice in notices:
            log.log(_LEVELS[notice.severity], "%s", notice.text, extra={"code": notice.code.value})

    def link_changed(self, name: str, up: bool, why: str) -> None:
        """Log that a link is up or down."""
        if up:
            log.info("link %s is up", name)
        else:
            log.warning("link %s is down: %s; trying again", name, _with_advice(why))

    def peer_refused(self, name: str, peer: str) -> None:
        """Log that a server link had no room for a peer, or dropped one; at most once a minute for a link."""
        log.warning("link %s: no place for %s: too many peers, or no valid MAVLink frame from it", name, peer)

    def detections_heard(self, listens: bool, why: str) -> None:
        """Log that the socket of the detections cannot be opened."""
        self.deaf_because = why
        if not listens:
            url = self._config.detections.url
            log.warning("cannot listen for detections on %s: %s; trying again", url, _with_advice(why))

    def pictures_seen(self, vision: VisionReport) -> None:
        """Log that the vision process has pictures, has none, or cannot work as it is configured."""
        source = shown_source(self._config.vision) if self._config.vision is not None else ""
        if vision.works:
            log.info("pictures arrive from %s", source)
        elif vision.stopped:
            log.error("detection stops until this is changed: %s", vision.why)
        else:
            log.warning("no pictures from %s: %s; trying again", source, vision.why)

    def clock_stepped(self, step: ClockStep) -> None:
        """Log a step of the wall clock."""
        log.warning("the wall clock was set by %+.3f s: no effect on this service", step.size_s)

    @property
    def faults(self) -> int:
        """Number of internal faults so far."""
        return self._faults.count

    def faulted(self, context: Mapping[str, object]) -> None:
        """Log an internal fault from the event loop."""
        self._faults.faulted(context)


def _with_advice(why: str) -> str:
    """The reason why a file or port does not open, with advice on the frequent one, another program."""
    return f"{why} (`check` names the program)" if "in use" in why else why


def warn(text: str) -> None:
    """Log a warning; callable from any thread."""
    log.warning("%s", text)
