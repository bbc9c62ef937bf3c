"""Which one target is the selected one: what the operator clicked, else by the configuration's rule."""

from __future__ import annotations

from collections.abc import Iterable

from fwav_companion.publishing.options import PublishOptions
from fwav_companion.types.tracks import Track, TrackState

BELIEVED = frozenset({TrackState.CONFIRMED, TrackState.COASTING})


class Selection:
    """Feed it every frame's tracks; ask it for the selected one."""

    def __init__(self, options: PublishOptions):
        self._by_rule = options.select == "best"
        self._label = options.label
        self._believed: dict[int, Track] = {}
        self._clicked: int | None = None
        self._stopped = False

    @property
    def believed(self) -> dict[int, Track]:
        """Confirmed and coasting tracks, by id, as they stood after the last frame."""
        return self._believed

    @property
    def by_click(self) -> bool:
        """The selected track is the operator's choice."""
        return self._clicked is not None

    @property
    def selected(self) -> Track | None:
        """The selected track; None if there is none to select, or the operator stopped the tracking."""
        if self._clicked is not None:
            return self._believed.get(self._clicked)
        if self._stopped or not self._by_rule:
            return None
        eligible = (track for track in self._believed.values() if self._label in {"", track.label})
        return min(eligible, key=seniority, default=None)

    def on_tracks(self, tracks: tuple[Track, ...]) -> None:
        """Take the tracks as they stand after a frame."""
        self._believed = {track.id: track for track in tracks if track.state in BELIEVED}
        if self._clicked is not None and self._clicked not in self._believed:
            self._clicked = successor(self._clicked, self._believed.values())

    def click(self, track_id: int) -> None:
        """The operator chose this track."""
        self._clicked, self._stopped = track_id, False

    def stop(self) -> None:
        """The operator wants none, until the next click."""
        self._clicked, self._stopped = None, True


def successor(ended: int, tracks: Iterable[Track]) -> int | None:
    """The track that an ended one turned out to be; None where it is just gone."""
    return next((track.id for track in tracks if ended in track.replaces), None)


def seniority(track: Track) -> tuple[int, int]:
    """Sorts by when a track was confirmed: the oldest first."""
    confirmed_ns = track.confirmed_host_ns if track.confirmed_host_ns is not None else track.host_ns
    return (confirmed_ns, track.id)
