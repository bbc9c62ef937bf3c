"""Tracks that begin, and the room for them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.tracking import reacquisition
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.filters.base import TargetState
from fwav_companion.tracking.track_state import LiveTrack, initiate
from fwav_companion.types import GroundFix, Reason, TrackState

MAX_TRACKS = 200
"""Live tracks at once. A frame has 256 detections at most."""


def with_new(
    tracks: list[LiveTrack],
    fixes: Sequence[GroundFix],
    host_ns: HostNs,
    next_id: int,
    *,
    target_of: Callable[[GroundFix], TargetState],
    branchings: reacquisition.Branchings,
    detector: DetectorModel,
) -> tuple[list[LiveTrack], int]:
    """The tracks with one initiated for each of these fixes that the table has room for, and the next free id."""
    room = MAX_TRACKS - sum(track.life.state is not TrackState.DROPPED for track in tracks)
    yielding = weakest_first(tracks) if len(fixes) > room else []
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
    return tracks, next_id


def weakest_first(tracks: Sequence[LiveTrack]) -> list[int]:
    """Places of the tracks without a fix in this frame that yield to a new one, in that order.

    Tentative ones first, by their score; then coasting ones, the one unseen the longest first, so that tracks out of
    view do not keep new targets out.
    """
    unseen = [(track.life, i) for i, track in enumerate(tracks) if track.fix is None]
    tentative = [
        (life.log_likelihood_ratio, life.last_seen_ns, i) for life, i in unseen if life.state is TrackState.TENTATIVE
    ]
    coasting = [(life.last_seen_ns, i) for life, i in unseen if life.state is TrackState.COASTING]
    return [i for *_, i in sorted(tentative)] + [i for _, i in sorted(coasting)]
