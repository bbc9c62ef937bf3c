"""Targets that may move and were still: only they calibrate in a configuration in which targets may move.

Beside each moving track the estimator has a static target in its place. As long as the static gate accepts the track's
sightings, the target is where it was. After PATIENCE_NS its sightings go to the solves; a target that leaves the gate
starts again, and its measurements so far are left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec
import numpy as np

from fwav_companion.estimation.frame_prediction import GATE2
from fwav_companion.estimation.initiation import begin_target
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.tracking.smoothed.smoothed_state import SmoothedState, StillTarget
from fwav_companion.tracking.smoothed.smoothed_track import SmoothedTrack
from fwav_companion.types.tracks import OUTSIDE_GATE, GateResult

PATIENCE_NS = 6 * NS_PER_S
"""Least time within the static gate before a target teaches, ns: a walking person leaves the gate within seconds."""
REFUSED = 3
"""Number of sightings in a row outside the static gate by which a target is known to have moved."""
FIRST_NUMBER = 1_000_000
"""Numbers of still targets in the estimator begin here: tracks have smaller ones."""
MOST_WAITING = 256
"""Sightings of a still target that are kept for the solves."""


def still_sightings(
    state: SmoothedState, seen: Sequence[tuple[int, SmoothedTrack]], sights: Sightings, host_ns: HostNs,
    gates: Mapping[tuple[int, int], GateResult],
) -> list[tuple[int, int, bool]]:  # fmt: skip
    """The rows of a frame's sightings that are also of a still target: index, its number, whether it teaches.

    ``seen``: confirmed tracks that may move, each with the index of its sighting. ``gates``: by target and that index.
    """
    known = [(i, track, still) for i, track in seen if (still := state.still.get(track.id)) is not None]
    rows = []
    for i, track, still in known:
        if gates.get((still.number, i), OUTSIDE_GATE).nis >= GATE2:
            state.still[track.id] = msgspec.structs.replace(still, refused=still.refused + 1)
            if still.refused + 1 >= REFUSED:
                _end(state, track.id)
            continue
        after = msgspec.structs.replace(
            still, refused=0, teaches=still.teaches or host_ns - still.since_ns >= PATIENCE_NS
        )
        state.still[track.id] = after
        own = sights.select(np.array([i])).with_targets(np.array([still.number]))
        waiting = state.waiting.get(still.number, ())
        if after.teaches:
            for each in waiting:
                state.estimator.record(each)
            state.waiting[still.number] = ()
            state.taught[still.number] = track.id
        else:
            state.waiting[still.number] = (*waiting, own)[-MOST_WAITING:]
        rows.append((i, still.number, after.teaches))
    for i, track in seen:
        if track.id not in state.still:
            _begin(state, track, sights.select(np.array([i])), host_ns)
    return rows


def _begin(state: SmoothedState, track: SmoothedTrack, own: Sightings, host_ns: HostNs) -> None:
    number = FIRST_NUMBER + state.next_still
    state.next_still += 1
    live = state.estimator.live
    if live is not None and begin_target(live, number, own, moving=False):
        state.still[track.id] = StillTarget(number, host_ns)


def _end(state: SmoothedState, track: int) -> None:
    still = state.still.pop(track)
    state.waiting.pop(still.number, None)
    state.taught.pop(still.number, None)
    state.estimator.forget(still.number)
