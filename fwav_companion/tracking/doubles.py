"""Two tracks of one target: no frame sees both, and whatever one of them takes might as well be the other's.

They come of the first seconds, when gates are wide, and share the target's fixes from then on: each takes those nearer
to itself, so that their estimates lie apart for good, farther than their claims allow, and no distance tells that they
are one. That no frame sees both does. It is weighed in looking time, as not being seen at all is (``lifecycle``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS
from fwav_companion.nouns import GroundFix, TrackState
from fwav_companion.tracking.alive import Alive
from fwav_companion.tracking.base import Belief
from fwav_companion.tracking.gates import GATE
from fwav_companion.tracking.lifecycle import GIVE_UP_NS

LOOK_NS = 100 * NS_PER_MS
"""What one look counts at most: so it takes 30 of them. Of two targets that a poor detector sees in every other frame,
30 looks in a row that saw one saw but one once in 200 000 times."""


class Doubles(msgspec.Struct, frozen=True):
    """Pairs of believed tracks that may be one. Immutable."""

    shared_ns: dict[tuple[int, int], int] = {}
    """By the ids of older and younger: looking time since a frame saw both, in which a fix of one might have been the
    other's."""

    def seen(self, before: Iterable[Alive], after: Sequence[Alive], belief_of: Callable[[Alive], Belief]) -> Doubles:
        """After a frame: the same tracks ``before`` and ``after`` it."""
        found = {track.id for track in after if track.fix is not None}
        living = {track.id for track in after if track.life.state is not TrackState.DROPPED}
        shared_ns = {
            pair: ns for pair, ns in self.shared_ns.items() if not found.issuperset(pair) and living.issuperset(pair)
        }
        for old, track in zip(before, after, strict=True):
            looked_ns = track.life.missing_ns - old.life.missing_ns
            if looked_ns <= 0 or not _is_believed(track):
                continue
            for other in _taken_by(after, track, belief_of(track)):
                pair = (min(track.id, other.id), max(track.id, other.id))
                shared_ns[pair] = shared_ns.get(pair, 0) + min(looked_ns, LOOK_NS)
        return Doubles(shared_ns) if shared_ns or self.shared_ns else self

    @property
    def replaced(self) -> dict[int, int]:
        """Which tracks are to end, and by which each is replaced: the older one."""
        return {younger: older for (older, younger), ns in self.shared_ns.items() if ns >= GIVE_UP_NS}


def _taken_by(tracks: Sequence[Alive], missed: Alive, belief: Belief) -> list[Alive]:
    """The believed tracks of this frame that took what might have been this one's."""

    def is_expected(fix: GroundFix | None) -> bool:
        return fix is not None and belief.surprise(fix).distance2 < GATE

    return [track for track in tracks if track.label == missed.label and _is_believed(track) and is_expected(track.fix)]


def _is_believed(track: Alive) -> bool:
    return track.life.confirmed_ns is not None and track.life.state is not TrackState.DROPPED
