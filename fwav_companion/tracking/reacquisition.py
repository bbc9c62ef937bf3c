"""Re-acquisition of a coasting track by evidence.

The gate of a coasting track that moves widens to metres within seconds. The gate of a static target seen from another
side is as wide as the errors of mount, delay and height. A false detection in such a gate is nearly as likely as the
target. So a single fix must not confirm the track again.

Track splitting (Smith & Buechler 1975; Blackman & Popoli 1999, ch. 16): a fix whose log-likelihood ratio alone does not
reach the threshold of confirmation begins a branch, a tentative track from the coasting state and this fix. The
coasting track continues without the fix. The sequential test of ``lifecycle`` continues over the branch. A confirmed
branch becomes the coasting track; a deleted branch leaves it unchanged. A branch is not reported; its id is negative. A
static target has no branches near other targets, nor in photographs, where one missed detection makes a track coast.
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
"""Log determinant ratio of a gate three times as wide as the noise of a fix. In a narrower gate a false fix does little
harm, because a small gain moves the estimate by only a part of that noise."""
STANDING_LLR = log(20.0)
"""Log-likelihood ratio of a fix that confirms a static target again: with equal priors the fix is the target's at 95 %.
A higher threshold would cost self-calibration the first sights from each side."""

Evidence: TypeAlias = tuple[GroundFix, float]
"""A fix, and its log-likelihood ratio against clutter."""
Branchings: TypeAlias = dict[int, tuple[LiveTrack, Evidence]]
"""Coasting tracks, each with a fix that is weak evidence for it, by the identity of the fix."""


def weak_evidence(tracks: Sequence[LiveTrack], taken: Mapping[int, Evidence], detector: DetectorModel) -> Branchings:
    """The coasting tracks whose fix alone does not confirm them again.

    ``taken``: fixes assigned to tracks, by track id.
    """
    coasting = [track for track in tracks if track.life.state is TrackState.COASTING and track.id in taken]
    if not coasting:
        return {}
    needed = {
        label: detector.confirming_llr(label) - log(detector.detection_probability)
        for label in {track.label for track in coasting}
    }
    for_standing = -inf if are_photographs(detector) else STANDING_LLR
    weak = [(track, taken[track.id]) for track in coasting if taken[track.id][1] < needed[track.label]]
    return {
        id(fix): (track, (fix, llr))
        for track, (fix, llr) in weak
        if track.target.gate(fix).log_det_ratio > WIDE
        and (
            track.target.velocity_cov is not None
            or (llr < min(for_standing, needed[track.label]) and not _is_shared(track, fix, tracks))
        )
    }


def _is_shared(track: LiveTrack, fix: GroundFix, tracks: Sequence[LiveTrack]) -> bool:
    """Whether the gate of another confirmed track accepts this fix, too.

    Static targets that are nearer to one another than their gates come into view one after the other. While branches
    of some of them wait for confirmation, the fixes of the next ones would go to the wrong tracks.
    """
    others = [each for each in tracks if each.confirmed and each.id != track.id and each.label == track.label]
    return any(each.target.gate(fix).nis < GATE for each in others)


def first_served(tracks: Sequence[LiveTrack]) -> set[int]:
    """Ids of the tracks that association prefers: confirmed tracks, and branches instead of their coasting tracks.

    A branch has its first fix as evidence. Otherwise the coasting track would take every fix from it, for one more
    branch.
    """
    branched_ids = {track.branch_of for track in tracks if track.branch_of}
    return {track.id for track in tracks if track.branch_of or (track.confirmed and track.id not in branched_ids)}


def branched(track: LiveTrack, evidence: Evidence, number: int, host_ns: HostNs, detector: DetectorModel) -> LiveTrack:
    """A branch: a tentative track from the coasting ``track`` and this fix. ``number``: id of the branch."""
    fix, llr = evidence
    branch = initiate(number, fix, track.target.update(fix), host_ns)
    life = msgspec.structs.replace(branch.life, log_likelihood_ratio=llr + log(detector.detection_probability))
    return msgspec.structs.replace(branch, life=life, branch_of=track.id)


def reacquired(tracks: list[LiveTrack], host_ns: HostNs) -> list[LiveTrack]:
    """The tracks of a frame. A branch that this frame confirmed becomes its coasting track, and is deleted.

    The other branches of a track that is confirmed again are deleted too, because the track explains their fixes.
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
    """The tracks of a frame, with own ids for the branches whose coasting track has ended; and the next free id."""
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
