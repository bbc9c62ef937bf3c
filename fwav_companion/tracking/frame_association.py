"""Association of one frame: which track has which fix."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import msgspec

from fwav_companion.tracking import reacquisition
from fwav_companion.tracking.association import associate
from fwav_companion.tracking.clutter import clutter
from fwav_companion.tracking.detector_ids import IdTrust
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.joint_compatibility import JointGate
from fwav_companion.tracking.lifecycle import is_steady
from fwav_companion.tracking.pair_costs import Candidate
from fwav_companion.tracking.self_calibrated import TargetChoice
from fwav_companion.tracking.track_state import LiveTrack
from fwav_companion.tracking.track_table import MAX_TRACKS
from fwav_companion.types import FrameView, GroundFix

Taken: TypeAlias = dict[int, reacquisition.Evidence]
"""Fix assigned to each track, by track id, with the log-likelihood ratio of the fix against clutter."""


class FrameAssociation(msgspec.Struct, frozen=True):
    """Result of the association of one frame: fixes assigned to tracks, and fixes that begin a branch of a track."""

    taken: Taken = {}
    branchings: reacquisition.Branchings = {}
    id_trust: dict[int, IdTrust] = {}
    """Trust in the detector's id of the fix that a track took, by track id."""

    def unused(self, fixes: Sequence[GroundFix]) -> list[GroundFix]:
        """The fixes of the frame that are assigned to no track."""
        used = {id(fix) for fix, _ in self.taken.values()}
        return [fix for fix in fixes if id(fix) not in used]


def associated(
    tracks: Sequence[LiveTrack], view: FrameView, choice: TargetChoice, joint: JointGate, detector: DetectorModel
) -> FrameAssociation:
    """The association of the fixes of a frame with ``tracks``, which are predicted to that frame."""
    if not (tracks and view.fixes):
        return FrameAssociation()
    against = clutter(detector, view.image_px2)
    found = associate(_candidates(tracks, view, choice), view.fixes, against, view.could_see, joint, detector.ids)
    taken = {tracks[i].id: (view.fixes[j], llr) for i, (j, llr) in found.pairs.items()}
    id_trust = {tracks[i].id: trust for i, trust in found.id_trust.items()}
    if len(tracks) + len(view.fixes) > MAX_TRACKS:  # a branch must not take the place of a target
        return FrameAssociation(taken, id_trust=id_trust)
    branchings = reacquisition.weak_evidence(tracks, taken, detector)
    for track, _ in branchings.values():
        del taken[track.id]
    return FrameAssociation(taken, branchings, id_trust)


def _candidates(tracks: Sequence[LiveTrack], view: FrameView, choice: TargetChoice) -> list[Candidate]:
    """The tracks as candidates of the association."""
    first = reacquisition.first_served(tracks)
    return [
        Candidate(
            track.label,
            choice.gated(track),
            track.detector_id,
            choice.calibrated(track),
            confirmed=track.id in first,
            steady=is_steady(track.life, view.host_ns),
            id_trust=track.id_trust,
        )
        for track in tracks
    ]
