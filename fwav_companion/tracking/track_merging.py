"""Merging of two tracks of one target, which take its fixes in turns: no frame has a fix for both.

Such pairs form in the first seconds, while gates are wide. Each track then takes the fixes nearer to itself. So their
estimates stay farther apart than their covariances allow, and no distance shows that they are one target. Fast
alternation shows it: if there were two targets with occasional missed detections, some frame would show both, and a
hidden target would be missed for longer. Slow alternation suffices if self-calibration then puts both tracks on one
place: one track took the fixes of one leg of the flight, the other those of the next.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import dist

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S
from fwav_companion.tracking.detector_ids import NO_IDS, IdEvidence
from fwav_companion.tracking.filters.base import TargetEstimate
from fwav_companion.tracking.filters.gates import GATE
from fwav_companion.tracking.filters.standing import gates_of
from fwav_companion.tracking.lifecycle import LOOK_S
from fwav_companion.tracking.self_calibrated import CalibratedTargetState
from fwav_companion.tracking.track_state import LiveTrack
from fwav_companion.types import GroundFix, TrackState

TURNS = 60
"""Number of looks with a fix for one of the two tracks, since a look with fixes for both. With a detector that misses
seven in ten, every sixth look that shows one of two targets shows both: 60 looks without that occur once in 100 000
times."""
FAST = 3
"""Most missed detections in a row in a fast turn. After a longer turn the missed target is hidden or has left."""
LOOK_NS = round(LOOK_S * NS_PER_S)
"""Longest time that one look counts, ns."""
ALTERNATING_NS = 3 * NS_PER_S
"""Least looking time of the turns, ns: a target that left is deleted within it."""


class AlternatingFixes(msgspec.Struct, frozen=True, gc=False):
    """Looks with a fix for one of two tracks that the other track's gate accepts, since a look with fixes for both."""

    count: int = 0
    """Number of looks in fast turns, less those in slow turns."""
    looked_ns: int = 0
    """Looking time in fast turns, ns."""
    looks: int = 0
    """Number of all these looks, in fast and in slow turns."""

    def with_look(self, looked_ns: int, *, fast: bool) -> AlternatingFixes:
        """The counts after one more look. Slow turns that outweigh the fast ones reset count and looking time."""
        looks = self.looks + 1
        if fast:
            return AlternatingFixes(self.count + 1, self.looked_ns + looked_ns, looks)
        return AlternatingFixes(max(0, self.count - 1), self.looked_ns if self.count > 1 else 0, looks)

    @property
    def are_one(self) -> bool:
        """Whether both are of one target: they alternated too often for two targets, and for as long as the track of a
        target that left is kept.
        """
        return self.count >= TURNS and self.looked_ns >= ALTERNATING_NS


class TrackMerging(msgspec.Struct, frozen=True):
    """Pairs of confirmed tracks that alternate. Immutable."""

    pairs: dict[tuple[int, int], AlternatingFixes] = {}
    """Alternation of each pair, by the ids of its senior and junior track."""

    def after_frame(
        self,
        tracks: Sequence[LiveTrack],
        missed: Sequence[int],
        elapsed_ns: int,
        target_of: Callable[[LiveTrack], TargetEstimate],
        *,
        ids: IdEvidence = NO_IDS,
    ) -> TrackMerging:
        """The pairs after a frame. ``missed``: ids of the tracks that it missed. ``elapsed_ns``: frame interval.

        ``ids``: how far the detector's own ids keep tracks apart.
        """
        if not missed and not self.pairs:
            return self
        found = {track.id for track in tracks if track.fix is not None}
        living = {track.id for track in tracks if track.life.state is not TrackState.DROPPED}
        pairs = {
            pair: turns for pair, turns in self.pairs.items() if living.issuperset(pair) and not found.issuperset(pair)
        }
        by_id = {track.id: track for track in tracks if track.id in living and track.confirmed}
        seen = [track for track in by_id.values() if track.fix is not None]
        looked_ns = min(elapsed_ns, LOOK_NS)
        for junior in (by_id[number] for number in missed if seen and number in by_id):
            for other in _substitutes(junior, seen, target_of, ids):
                pair = tuple(track.id for track in sorted((junior, other), key=seniority))
                turns = pairs.get((pair[0], pair[1]), AlternatingFixes())
                pairs[pair[0], pair[1]] = turns.with_look(looked_ns, fast=junior.life.misses <= FAST)
        return TrackMerging(pairs) if pairs or self.pairs else self

    def merged(
        self, tracks: Sequence[LiveTrack], target_of: Callable[[LiveTrack], TargetEstimate]
    ) -> Sequence[LiveTrack]:
        """The tracks after merging. A junior ends only in a frame with a fix for its senior, so that no fix is lost."""
        if not self.pairs:
            return tracks
        by_id = {track.id: track for track in tracks}
        for (senior, junior), turns in self.pairs.items():
            one, other = by_id[senior], by_id[junior]
            if turns.looks < TURNS or one.fix is None or other.life.state is TrackState.DROPPED:
                continue
            if turns.are_one or _coincide(target_of(one), target_of(other), one.fix):
                by_id[senior], by_id[junior] = one.merged(other)
        return list(by_id.values())


def seniority(track: LiveTrack) -> tuple[int, int]:
    """Sort key of confirmed tracks: the track confirmed first comes first."""
    return (track.life.confirmed_ns or 0, track.id)


def _substitutes(
    missed: LiveTrack, seen: Sequence[LiveTrack], target_of: Callable[[LiveTrack], TargetEstimate], ids: IdEvidence
) -> list[LiveTrack]:
    """The confirmed tracks whose fix in this frame the missed track's gate accepts."""
    alike = [track for track in seen if track.label == missed.label]
    others = [track for track in alike if not ids.distinguish(track.detector_id, missed.detector_id)]
    gated = gates_of(target_of(missed), [track.fix for track in others if track.fix is not None]) if others else ()
    return [track for track, result in zip(others, gated, strict=True) if result.nis < GATE]


def _coincide(one: TargetEstimate, other: TargetEstimate, fix: GroundFix) -> bool:
    """Whether self-calibration puts both nearer to each other than the noise of a single fix, and cannot separate them.

    Estimates without self-calibration differ by the errors of the two legs, and could coincide while one of two targets
    is hidden. Two targets that are known to be apart stay two, however long one of them is hidden.
    """
    if not (isinstance(one, CalibratedTargetState) and isinstance(other, CalibratedTargetState)):
        return False
    (nn, _, _), (_, ee, _), _ = fix.noise_cov
    near = dist(one.position_ned[:2], other.position_ned[:2]) ** 2 < nn + ee
    return near and one.separation2(other.track) < GATE
