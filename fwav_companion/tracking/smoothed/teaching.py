"""Which of a frame's sightings the live filter and the solves are given, and when a target is forgotten.

A confirmed static track teaches, with the sightings from before its confirmation. A target that may move does not;
where it has been still for long, a static target in its place does (``still_targets``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fwav_companion.estimation.ground import TargetPrior
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.tracking.smoothed.flight_ground import target_height
from fwav_companion.tracking.smoothed.smoothed_state import SmoothedState
from fwav_companion.tracking.smoothed.smoothed_track import SmoothedTrack
from fwav_companion.tracking.smoothed.still_targets import still_sightings
from fwav_companion.types import ErrorPriors, FrameView, TrackState
from fwav_companion.types.tracks import GateResult

MOST_WAITING = 64
"""Sightings of a tentative track that are kept for the solves."""


def teach(
    state: SmoothedState, view: FrameView, sights: Sightings, tracks: Sequence[SmoothedTrack], priors: ErrorPriors,
    gates: Mapping[tuple[int, int], GateResult],
) -> None:  # fmt: skip
    """Hand the frame's sightings to the live filter, and those of confirmed static tracks to the solves.

    ``gates``: gating statistics of its pairs, by target and index of the fix.
    """
    estimator, index = state.estimator, {id(fix): i for i, fix in enumerate(view.fixes)}
    surveyed = {sight.fix.sighting.index: sight for sight in view.landmarks}
    rows: list[tuple[int, int, bool]] = []
    seen = [(index[id(track.fix)], track) for track in tracks if track.fix is not None and track.id in state.waiting]
    for i, track in seen:
        teaches = track.confirmed and not track.moving
        if teaches:
            _release(state, track, priors)
            sight = surveyed.get(view.fixes[i].sighting.index)
            if sight is not None and track.id > 0:
                state.landmarks.add(sight, track.id, estimator, state.reference, state.waiting)
        elif not track.moving:
            own = sights.select(np.array([i])).with_targets(np.array([track.id]))
            state.waiting[track.id] = (*state.waiting[track.id], own)[-MOST_WAITING:]
        if track.life.detections > 1 or teaches:  # the first one began the target
            rows.append((i, track.id, teaches))
    moving = [(i, track) for i, track in seen if track.moving and track.confirmed]
    if moving:
        rows += still_sightings(state, moving, sights, view.host_ns, gates)
    if rows:
        rows.sort()
        which, targets, teaching = (np.array(column) for column in zip(*rows, strict=True))
        estimator.update_pairs(sights, which, targets, teaching)


def teach_displaced(
    state: SmoothedState, sights: Sightings, displaced: Mapping[int, int], tracks: Sequence[SmoothedTrack]
) -> None:
    """Keep sightings beyond the gates of their tracks for the solves. ``displaced``: tracks by index of the fix."""
    confirmed = {track.id for track in tracks if track.confirmed}
    for fix, number in sorted(displaced.items()):
        if number in confirmed:
            state.estimator.refuse(sights.select(np.array([fix])).with_targets(np.array([number])))


def _release(state: SmoothedState, track: SmoothedTrack, priors: ErrorPriors) -> None:
    """Hand over the sightings of a track from before its confirmation, and the height of its target."""
    for sights in state.waiting[track.id]:
        state.estimator.record(sights)
    state.waiting[track.id] = ()
    height_m, sigma_m = target_height(track.last_fix, priors)
    if (height_m or sigma_m) and track.id not in state.landmarks.tracks:
        state.estimator.targets[track.id] = TargetPrior(height_m=height_m, height_sigma_m=sigma_m)


def forget_ended(state: SmoothedState, tracks: Sequence[SmoothedTrack]) -> None:
    """Delete what belongs to tracks that have ended."""
    for track in tracks:
        if track.life.state is TrackState.DROPPED:
            still = state.still.pop(track.id, None)
            for number in (track.id, *(() if still is None else (still.number,))):
                state.waiting.pop(number, None)
                state.estimator.drop(number)
            if not track.confirmed:  # a confirmed one's sightings go on to teach
                state.estimator.targets.pop(track.id, None)
