"""The sights of confirmed targets through a replay, thinned to a bounded number. PURE."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TypeAlias

from fwav_companion.config import Config
from fwav_companion.recording.summary_types import SharedErrorObject
from fwav_companion.tracking import Settled
from fwav_companion.types import Sighting, TrackState

MOST_SIGHTS = 40
"""Most sights that are kept of a target: they are spread over all of its time."""
MOST_TARGETS = 30

SharedErrors: TypeAlias = Callable[[Mapping[int, Sequence[Sighting]], Config, Sequence[float]], list[SharedErrorObject]]
"""Estimates the errors that all pictures share from the sights of each target; the configuration has the priors, and
the last argument the down components of the targets, metres.
"""


class KeptSights:
    """Sights by track, of those that were confirmed once."""

    def __init__(self) -> None:
        self._sights: dict[int, list[Sighting]] = {}
        self._strides: dict[int, int] = {}
        self._counts: dict[int, int] = {}
        self._confirmed: dict[int, float] = {}
        """Down component of the last place of each track that was confirmed once, metres."""

    def add(self, frames: Iterable[Settled]) -> list[Settled]:
        """Keep the sights of these frames; returns the same frames."""
        settled = list(frames)
        for frame in settled:
            for track in frame.tracks:
                if track.state is TrackState.CONFIRMED:
                    self._confirmed[track.id] = track.position_ned[2]
                if track.fix is not None:
                    self._keep(track.id, track.fix.sighting)
        return settled

    def _keep(self, track: int, sighting: Sighting) -> None:
        kept, stride = self._sights.setdefault(track, []), self._strides.setdefault(track, 1)
        count = self._counts.get(track, 0)
        self._counts[track] = count + 1
        if count % stride:
            return
        kept.append(sighting)
        if len(kept) > MOST_SIGHTS:
            del kept[1::2]
            self._strides[track] = 2 * stride

    def downs(self) -> list[float]:
        """The down components of the confirmed tracks."""
        return list(self._confirmed.values())

    def confirmed(self) -> dict[int, Sequence[Sighting]]:
        """The sights of confirmed tracks, those with the most first."""
        found = {track: sights for track, sights in self._sights.items() if track in self._confirmed}
        most = sorted(found, key=lambda track: self._counts[track], reverse=True)[:MOST_TARGETS]
        return {track: found[track] for track in most}
