"""Two tracks of one target: they take its fixes in turns, and no frame sees both.

They come of the first seconds, when gates are wide. From then on each takes the fixes that lie nearer to itself, so
that their estimates stay apart for good, farther than their claims allow, and no distance tells that they are one. That
they take turns does, fast ones: of two targets that a detector misses now and then, some frame shows both, and one that
hides is missed for longer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

import msgspec

from fwav_companion.tracking.filters.base import TargetState
from fwav_companion.tracking.filters.gates import GATE
from fwav_companion.tracking.lifecycle import GIVE_UP_NS
from fwav_companion.tracking.track_state import LiveTrack
from fwav_companion.types import GroundFix, TrackState

TURNS = 60
"""Looks that saw one of the two, since one that saw both. By a detector that misses seven sights in ten, every sixth
look that shows one shows both: 60 pass without once in 100 000 times."""
FAST = 3
"""Looks in a row: a turn that has lasted for longer speaks against turns. Who is missed then hides, or left."""


class AlternatingFixes(msgspec.Struct, frozen=True, gc=False):
    """Since a frame saw both of two tracks: looks that saw one, by a fix that might have been the other's."""

    count: int = 0
    """Of those in fast turns, less those in slow ones."""
    looked_ns: int = 0
    """Looking time of those in fast turns."""

    def with_look(self, looked_ns: int, *, fast: bool) -> AlternatingFixes:
        """One more. Slow turns that outweigh the fast ones leave nothing of them."""
        if fast:
            return AlternatingFixes(self.count + 1, self.looked_ns + looked_ns)
        return AlternatingFixes(self.count - 1, self.looked_ns) if self.count > 1 else AlternatingFixes()

    @property
    def are_one(self) -> bool:
        """They took turns as often as two targets never do, and for as long as it takes to give up a target."""
        return self.count >= TURNS and self.looked_ns >= GIVE_UP_NS


class TrackMerging(msgspec.Struct, frozen=True):
    """Pairs of believed tracks that take turns. Immutable."""

    pairs: dict[tuple[int, int], AlternatingFixes] = {}
    """By the ids of senior and junior."""

    def seen(
        self, before: Iterable[LiveTrack], after: Sequence[LiveTrack], belief_of: Callable[[LiveTrack], TargetState]
    ) -> TrackMerging:
        """After a frame: the same tracks ``before`` and ``after`` it."""
        found = {track.id for track in after if track.fix is not None}
        living = {track.id for track in after if track.life.state is not TrackState.DROPPED}
        pairs = {
            pair: turns for pair, turns in self.pairs.items() if living.issuperset(pair) and not found.issuperset(pair)
        }
        for old, missed in zip(before, after, strict=True):
            looked_ns = missed.life.missing_ns - old.life.missing_ns
            if looked_ns > 0 and _is_believed(missed):
                for other in _in_its_stead(missed, after, belief_of):
                    senior, junior = sorted((missed, other), key=seniority)
                    turns = pairs.get((senior.id, junior.id), AlternatingFixes())
                    pairs[senior.id, junior.id] = turns.with_look(looked_ns, fast=missed.life.misses <= FAST)
        return TrackMerging(pairs) if pairs or self.pairs else self

    def settled(self, tracks: Sequence[LiveTrack]) -> list[LiveTrack]:
        """The tracks, juniors ended whose senior was just seen: nothing is lost with them then."""
        by_id = {track.id: track for track in tracks}
        for (senior, junior), turns in self.pairs.items():
            if turns.are_one and by_id[senior].fix is not None and _is_believed(by_id[junior]):
                by_id[senior], by_id[junior] = by_id[senior].replacing(by_id[junior])
        return list(by_id.values())


def seniority(track: LiveTrack) -> tuple[int, int]:
    """Sorts believed tracks: the one that was confirmed first comes first."""
    return (track.life.confirmed_ns or 0, track.id)


def _in_its_stead(
    missed: LiveTrack, tracks: Sequence[LiveTrack], belief_of: Callable[[LiveTrack], TargetState]
) -> Iterator[LiveTrack]:
    """The believed tracks of this frame that took what might have been this one's."""
    belief: TargetState | None = None
    for track in tracks:
        if (
            track.fix is not None
            and track.label == missed.label
            and _is_believed(track)
            and not _told_apart(track, missed)
        ):
            belief = belief or belief_of(missed)
            if _is_expected(track.fix, belief):
                yield track


def _is_expected(fix: GroundFix, belief: TargetState) -> bool:
    return belief.gate(fix).nis < GATE


def _told_apart(one: LiveTrack, other: LiveTrack) -> bool:
    """By the detector's own ids."""
    return one.detector_id is not None and other.detector_id is not None and one.detector_id != other.detector_id


def _is_believed(track: LiveTrack) -> bool:
    return track.life.confirmed_ns is not None and track.life.state is not TrackState.DROPPED
