"""Everything that leaves for people and autopilots, from the tracks of each frame."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.nouns.commands import Command, CommandAnswer
from fwav_companion.nouns.messages import Notice, Outgoing
from fwav_companion.nouns.sightings import GroundFix
from fwav_companion.nouns.situation import Situation
from fwav_companion.nouns.tracks import Track
from fwav_companion.publishing.landing import Landing
from fwav_companion.publishing.options import PublishOptions

Locate: TypeAlias = Callable[[float, float, float, HostNs], GroundFix | None]
"""(u, v, sigma_px, host_ns) -> the ground under that pixel of a picture taken then, None where there is no telling."""
PixelFromNed: TypeAlias = Callable[[Vector3], tuple[float, float] | None]
"""Where a place would be in the image of the frame just processed; None outside."""


class Publisher:
    """Hand it every processed frame's tracks, the commands to our components, notices, and its own wakes."""

    def __init__(self, options: PublishOptions, locate: Locate | None = None):
        self._options = options
        self._locate = locate
        self.landing = Landing(options)

    @property
    def wake_at(self) -> HostNs | None:
        """When :meth:`on_wake` is due next."""
        return None

    def on_tracks(
        self, tracks: tuple[Track, ...], situation: Situation, pixel_from_ned: PixelFromNed | None = None
    ) -> list[Outgoing]:
        """Once a processed frame, at once: the landing target waits for nothing."""
        landing = self.landing.on_tracks(tracks, situation)
        return [landing] if landing is not None else []

    def on_wake(self, now: HostNs, situation: Situation) -> list[Outgoing]:
        """What is sent by the clock: tracking status, named values, map markers."""
        return []

    def on_command(self, command: Command, situation: Situation) -> CommandAnswer | None:
        """An operator's command to our camera; None: it is not one of ours."""
        return None

    def on_notice(self, notice: Notice, now: HostNs) -> list[Outgoing]:
        """Tell people, where the notice asks for it."""
        return []

    def datagrams(self) -> list[bytes]:
        """Cursor on Target events made since the last call, for the configured address."""
        return []

    def status(self) -> dict[str, Any]:
        """For the status file."""
        return {}
