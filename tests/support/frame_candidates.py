"""The association of one frame of hand-made candidates: targets that only gate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from handmade import host_ns

from fwav_companion.tracking.detector_ids import IdEvidence
from fwav_companion.tracking.filters.base import GATE
from fwav_companion.tracking.id_pairs import IdPairs
from fwav_companion.tracking.lifecycle import Life
from fwav_companion.tracking.live_track import LiveTrack
from fwav_companion.tracking.pair_assignment import FramePairs, assigned, possible_costs
from fwav_companion.types import TrackState

NOW, BEFORE, NO_IDS = host_ns(9.0), host_ns(8.0), IdEvidence()


@dataclass
class Candidate:
    """A track for the fixes of a frame."""

    label: str
    target: Any
    """What gates the fixes."""
    detector_id: int | None
    confirmed: bool = True
    steady: bool = True
    """Whether it was detected just before."""

    def track(self, number):
        """The track with this id."""
        seen_ns = NOW if self.steady else BEFORE
        state = TrackState.TENTATIVE
        if self.confirmed:
            state = TrackState.CONFIRMED if self.steady else TrackState.COASTING
        life = Life(state, BEFORE, seen_ns, confirmed_ns=BEFORE if self.confirmed else None)
        return LiveTrack(number, self.label, False, life, None, detector_id=self.detector_id)


def associate(candidates, fixes, against, could_see=None, ids=NO_IDS):
    """The index of the fix of each candidate that takes one, with its log-likelihood ratio, by the candidate's index.

    ``could_see``: whether a place is in view; None: no miss costs anything.
    """
    tracks = [candidate.track(i) for i, candidate in enumerate(candidates)]
    gates = {
        (i, j): candidate.target.gate(fix)
        for i, candidate in enumerate(candidates)
        for j, fix in enumerate(fixes)
        if fix.sighting.detection.label == candidate.label
    }
    pairs = FramePairs(fixes, against, gates, gates, [against.llr_of(fix) + against.detection_odds for fix in fixes])
    by_id = IdPairs(dict(enumerate(tracks)), fixes, ids, lambda track: candidates[track.id].target.relative_cov)
    taken = assigned(
        tracks, possible_costs(tracks, pairs, NOW, GATE), pairs, {track.id for track in tracks if track.confirmed},
        lambda track: could_see is not None and could_see(candidates[track.id].target.apparent_ned), by_id.with_bonus,
    )  # fmt: skip
    return {number: (took.index, took.log_likelihood_ratio) for number, took in taken.items()}
