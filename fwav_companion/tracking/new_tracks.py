"""Initiation of tracks from fixes that no track took, and the limit on the number of tracks."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.tracking import reacquisition
from fwav_companion.tracking.detector_ids import NO_IDS, IdEvidence
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.filters.base import TargetState
from fwav_companion.tracking.filters.gates import GATE
from fwav_companion.tracking.filters.standing import gates_of
from fwav_companion.tracking.lifecycle import is_steady
from fwav_companion.tracking.track_state import LiveTrack, initiate
from fwav_companion.tracking.track_table import MAX_TRACKS, weakest_first
from fwav_companion.types import Detection, GroundFix, Reason, TrackState


class Begun(msgspec.Struct, frozen=True):
    """The tracks after a frame, initiated ones included, and the number of its fixes that initiated none."""

    tracks: Sequence[LiveTrack]
    next_id: int
    refused: int = 0
    """Number of fixes for which the track table had no room."""
    strays: int = 0
    """Number of fixes in the gate of a steady track (``without_strays``)."""


def with_new(
    before: Begun,
    fixes: Sequence[GroundFix],
    host_ns: HostNs,
    *,
    target_of: Callable[[GroundFix], TargetState],
    branchings: reacquisition.Branchings,
    detector: DetectorModel,
) -> Begun:
    """The tracks, and one initiated from each of these fixes for which the track table has room."""
    tracks, next_id = list(before.tracks), before.next_id
    room = MAX_TRACKS - sum(track.life.state is not TrackState.DROPPED for track in tracks)
    calm = [fix for fix in fixes if fix.sighting.detection.label not in detector.crowd.labels]
    yielding = weakest_first(tracks, most_coasting=len(calm)) if len(fixes) > room else []
    for i in yielding[: max(0, len(fixes) - room)]:
        tracks[i] = tracks[i].deleted(Reason.TOO_MANY_TRACKS)
    number = min(len(fixes), room + len(yielding))
    branch_id = min([0, *(track.id for track in tracks)])
    for fix in fixes[:number]:
        if id(fix) in branchings:
            branch_id -= 1
            tracks.append(reacquisition.branched(*branchings[id(fix)], branch_id, host_ns, detector))
        else:
            tracks.append(initiate(next_id, fix, target_of(fix), host_ns))
            next_id += 1
    return Begun(tracks, next_id, refused=len(fixes) - number)


def without_strays(
    fixes: Sequence[GroundFix],
    tracks: Sequence[LiveTrack],
    taken: Container[int],
    host_ns: HostNs,
    *,
    ids: IdEvidence = NO_IDS,
) -> list[GroundFix]:
    """The fixes that are not in the gate of a steady track without a fix in this frame.

    A fix in such a gate is not evidence of another target. Association refuses it where a false detection and a missed
    target are likelier. A track initiated with it would share its error, such as a height error that several frames
    repeat, and would take the next fixes of the same target from the confirmed track.
    ``taken``: ids of the tracks with a fix. ``ids``: how far the detector's own ids keep things apart.
    """
    left = list(fixes)
    for track in tracks:
        if left and track.id not in taken and is_steady(track.life, host_ns):
            left = _outside_gate(track, left, ids)
    return left


def _outside_gate(track: LiveTrack, fixes: Sequence[GroundFix], ids: IdEvidence) -> list[GroundFix]:
    """The fixes that are not in the gate of this track."""
    own = [fix for fix in fixes if _may_be_of(track, fix.sighting.detection, ids)]
    gated = {id(fix) for fix, seen in zip(own, gates_of(track.target, own), strict=True) if seen.nis < GATE}
    return [fix for fix in fixes if id(fix) not in gated]


def _may_be_of(track: LiveTrack, detection: Detection, ids: IdEvidence) -> bool:
    return track.label == detection.label and not ids.distinguish(track.detector_id, detection.detector_id)


def unused_fixes(tracks: Sequence[LiveTrack], begun: Begun) -> dict[Reason, int]:
    """Number of fixes of a frame that are assigned to no reported track, by reason. ``tracks``: after the frame."""
    weak = begun.strays + sum([track.id < 0 and track.fix is not None for track in tracks])
    if not (weak or begun.refused):
        return {}
    counts = {Reason.TOO_MANY_TRACKS: begun.refused, Reason.WEAK_EVIDENCE: weak}
    return {reason: count for reason, count in counts.items() if count}
