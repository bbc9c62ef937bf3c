"""Re-acquisition of a coasting track by evidence.

The gate of a coasting track that moves widens to metres within seconds, and that of a standing target seen from another
side is as wide as the errors of mount, delay and height: a false detection in it is nearly as likely as the target. One
such fix must not confirm it again. Track splitting (Smith & Buechler 1975; Blackman & Popoli 1999, ch. 16): a fix whose
log-likelihood ratio alone does not reach the threshold of confirmation begins a branch, a tentative track from the
coasting state and this fix. The coasting track goes on without the fix. The sequential test of ``lifecycle`` continues
over the branch: confirmed, it becomes the coasting track; deleted, its fixes have changed nothing. A branch is not
reported; its id is negative. A standing target has no branches in photographs, where one missed detection makes a track
coast, and beside others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, log
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.filters.gates import GATE
from fwav_companion.tracking.lifecycle import are_photographs
from fwav_companion.tracking.track_state import LiveTrack, initiate
from fwav_companion.types import GroundFix, Reason, TrackState

WIDE = 4.0 * log(3.0)
"""Log determinant ratio of a gate three times as wide as the noise of a fix. In a narrow one a false fix does little: a
small gain moves the estimate by a part of that noise."""
STANDING_LLR = log(20.0)
"""Log-likelihood ratio of a fix that confirms a standing target again: with equal priors it is the target's at 95 %.
More would cost self-calibration the first sights from each side."""

Evidence: TypeAlias = tuple[GroundFix, float]
"""A fix, and its log-likelihood ratio against clutter."""
Branchings: TypeAlias = dict[int, tuple[LiveTrack, Evidence]]
"""Coasting tracks with a fix that is weak evidence for them, by the identity of the fix."""


def weak_evidence(tracks: Sequence[LiveTrack], taken: Mapping[int, Evidence], detector: DetectorModel) -> Branchings:
    """The coasting tracks that their fix alone does not confirm again.

    ``taken``: the fixes of tracks, by id.
    """
    coasting = [track for track in tracks if track.life.state is TrackState.COASTING and track.id in taken]
    if not coasting:
        return {}
    needed = detector.confirming_llr - log(detector.detection_probability)
    for_standing = -inf if are_photographs(detector) else min(needed, STANDING_LLR)
    weak = [(track, taken[track.id]) for track in coasting if taken[track.id][1] < needed]
    return {
        id(fix): (track, (fix, llr))
        for track, (fix, llr) in weak
        if track.target.gate(fix).log_det_ratio > WIDE
        and (track.target.velocity_cov is not None or (llr < for_standing and not _is_shared(track, fix, tracks)))
    }


def _is_shared(track: LiveTrack, fix: GroundFix, tracks: Sequence[LiveTrack]) -> bool:
    """Whether another confirmed track may have this fix, too.

    Standing targets that are nearer to one another than their gates are seen one after the other as they come into
    view: while branches of some wait, the fixes of the next ones would go to the wrong tracks.
    """
    others = [each for each in tracks if each.confirmed and each.id != track.id and each.label == track.label]
    return any(each.target.gate(fix).nis < GATE for each in others)


def first_served(tracks: Sequence[LiveTrack]) -> set[int]:
    """Ids of the tracks that association prefers: the confirmed ones, and branches in the place of their track.

    A branch has its first fix as evidence: its track would otherwise take every fix from it, for one more branch.
    """
    branched_ids = {track.branch_of for track in tracks if track.branch_of}
    return {track.id for track in tracks if track.branch_of or (track.confirmed and track.id not in branched_ids)}


def branched(track: LiveTrack, evidence: Evidence, number: int, host_ns: HostNs, detector: DetectorModel) -> LiveTrack:
    """A tentative track: the coasting one, if this fix is its own. ``number`` distinguishes it from other branches."""
    fix, llr = evidence
    branch = initiate(number, fix, track.target.update(fix), host_ns)
    life = msgspec.structs.replace(branch.life, log_likelihood_ratio=llr + log(detector.detection_probability))
    return msgspec.structs.replace(branch, life=life, branch_of=track.id)


def reacquired(tracks: list[LiveTrack], host_ns: HostNs) -> list[LiveTrack]:
    """The tracks of a frame; a branch that it confirmed has become its coasting track, and ends.

    The branches of a track that is confirmed again end too: what they explain differently is its own.
    """
    branches = [i for i, track in enumerate(tracks) if track.branch_of and track.life.state is not TrackState.DROPPED]
    if not branches:
        return tracks
    after, places = list(tracks), {track.id: i for i, track in enumerate(tracks)}
    for i in sorted(branches, key=lambda i: tracks[i].life.confirmed_ns != host_ns):
        place = places.get(tracks[i].branch_of or 0)
        if place is None:
            continue
        if after[place].life.state is TrackState.CONFIRMED:
            after[i] = after[i].deleted(Reason.NEVER_CONFIRMED)
        elif after[i].life.confirmed_ns == host_ns and after[place].life.state is TrackState.COASTING:
            after[place], after[i] = after[place].reacquired(after[i])
    return after


def independent(tracks: Sequence[LiveTrack], next_id: int) -> tuple[Sequence[LiveTrack], int]:
    """The tracks of a frame with ids for the branches whose coasting track has ended, and the next free id."""
    branches = [track for track in tracks if track.branch_of and track.life.state is not TrackState.DROPPED]
    if not branches:
        return tracks, next_id
    living = {track.id for track in tracks if track.life.state is not TrackState.DROPPED}
    freed = [track for track in branches if track.branch_of not in living]
    if not freed:
        return tracks, next_id
    numbered = [
        msgspec.structs.replace(track, id=number, branch_of=None) for number, track in enumerate(freed, next_id)
    ]
    return [track for track in tracks if track not in freed] + numbered, next_id + len(freed)
