"""SHELL: how this run is doing, as the status file has it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import msgspec

from fwav_companion import __version__
from fwav_companion.config import Config
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.links.base import Link
from fwav_companion.mavlink.router.node import Node
from fwav_companion.pipeline.pipeline import Pipeline
from fwav_companion.service.journal import Journal
from fwav_companion.service.log import ServiceLog
from fwav_companion.service.timer import HostClock
from fwav_companion.vision.supervisor import VisionProcess


class StatusReport:
    """Asks every part; counts the frames that come, whatever becomes of them."""

    def __init__(
        self,
        config: Config,
        clock: HostClock,
        node: Node,
        links: Mapping[str, Link],
        vision: VisionProcess | None,
        journal: Journal,
        pipeline: Pipeline,
        sayings: ServiceLog,
    ) -> None:
        self._config = config
        self._clock = clock
        self._node = node
        self._links = links
        self._vision = vision
        self._journal = journal
        self._pipeline = pipeline
        self._sayings = sayings
        self._came, self._came_ns = 0, HostNs(0)

    def frame_came(self, now: HostNs) -> None:
        """From another process or from our own camera."""
        self._came, self._came_ns = self._came + 1, now

    def as_object(self, now: HostNs) -> dict[str, object]:
        """For JSON."""
        return {
            "version": __version__,
            "pid": os.getpid(),
            "config": self._config.file,
            "config_path": str(Path(self._config.file).absolute()),
            "time_unix": self._clock.unix_us(now) / 1e6,
            "time_monotonic": now / NS_PER_S,
            "internal_faults": self._sayings.faults,
            "links": {name: link.status() for name, link in self._links.items()},
            "traffic": msgspec.to_builtins(self._node.statistics(now)),
            "intake": {
                "came": self._came,
                "age_s": (now - self._came_ns) / NS_PER_S if self._came else None,
                "why": self._sayings.deaf_because,
            },
            "vision": None if self._vision is None else self._vision.status(),
            "recording": self._journal.state,
            **self._pipeline.status(now),
        }
