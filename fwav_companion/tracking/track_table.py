"""What a frame's tracks show of the detector, and which tracks leave a full table; for tracks of any filter. PURE."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.tracking.crowd import Crowd
from fwav_companion.tracking.detector_ids import CERTAIN, IdTrust
from fwav_companion.tracking.detector_model import DetectorModel, false_share
from fwav_companion.tracking.lifecycle import Life
from fwav_companion.types import GroundFix, Reason, TrackState

MAX_TRACKS = 200
"""Maximum number of live tracks. A frame has at most 256 detections."""


class TrackRow(Protocol):
    """A live track's life and its fix of the newest frame."""

    @property
    def id(self) -> int:
        """Track number."""

    @property
    def life(self) -> Life:
        """Life-cycle state."""

    @property
    def fix(self) -> GroundFix | None:
        """Fix of the newest frame."""

    @property
    def detector_id(self) -> int | None:
        """The detector's id of the last fix that had one."""


def detector_after(
    detector: DetectorModel,
    host_ns: HostNs,
    before: Sequence[TrackRow],
    after: Sequence[TrackRow],
    *,
    refused: int,
    id_trust: Mapping[int, IdTrust],
    crowd: Crowd,
) -> DetectorModel:
    """The detector model after a frame. ``after``: the same tracks in order, then those that the frame initiated.

    ``id_trust``: trust in the detector's ids of the fixes, by track id.
    ``refused``: number of fixes for which the track table had no room. ``crowd``: that after the frame.
    The fixes of a tentative track count by the probability that the track is clutter: a first photograph of twenty
    animals is not evidence of twenty false detections.
    """
    hits, looks, false, undecided = 0, 0, float(refused), 0.0
    ids = []
    for old, now in zip(before, after, strict=False):
        if now.fix is not None and old.detector_id is not None:
            met = id_trust.get(old.id, CERTAIN).met
            ids.append((old.detector_id, now.fix.sighting.detection.detector_id, met))
        if now.fix is not None and old.life.confirmed_ns is not None:
            detections = now.life.detections - old.life.detections
            hits, looks = hits + detections, looks + max(detections, 1 + old.life.misses)
    for life in [track.life for track in after if track.life.confirmed_ns is None]:
        if life.reason is Reason.REPLACED:
            continue
        expected = life.detections * false_share(life.log_likelihood_ratio)
        if life.state is TrackState.DROPPED:
            false += expected
        else:
            undecided += expected
    evidence = detector.ids.after(ids) if ids else detector.ids
    return detector.after_frame(
        host_ns, detected=hits, looks=looks, false=false, undecided=undecided, ids=evidence, crowd=crowd
    )


def weakest_first(tracks: Sequence[TrackRow], *, most_coasting: int) -> list[int]:
    """Indices of the tracks without a fix in this frame that may be deleted for new tracks, in order of deletion.

    Tentative tracks come first, by their score; then coasting tracks, the longest unseen first, so that tracks out of
    view do not keep new targets out. ``most_coasting``: number of fixes for which they may: a crowd of false detections
    must not end a known target that it hides.
    """
    lives = {i: track.life for i, track in enumerate(tracks) if track.fix is None}
    tentative = [i for i, life in lives.items() if life.state is TrackState.TENTATIVE]
    coasting = [i for i, life in lives.items() if life.state is TrackState.COASTING]
    tentative.sort(key=lambda i: (lives[i].log_likelihood_ratio, lives[i].last_seen_ns))
    return tentative + sorted(coasting, key=lambda i: lives[i].last_seen_ns)[:most_coasting]
