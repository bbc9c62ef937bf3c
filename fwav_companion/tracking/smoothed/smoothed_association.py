"""Which fix of a frame is of which track, by the live filter's joint innovation covariance.

One to one, least sum of costs (Blackman & Popoli 1999, ch. 6). The cost of a pair is its squared distance plus the log
determinant of its innovation covariance, against clutter and a missed detection. Noise that the frame's detections
share and the vehicle's errors are in the joint covariance: targets displaced alike are one surprise. Pairs without a
rival show the displacement of the frame, and the gates of the other pairs are those given it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import log, pi, prod

import msgspec
import numpy as np

from fwav_companion.estimation.errors import Bools
from fwav_companion.estimation.frame_prediction import GATE2, FramePrediction
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.tracking.assignment import least_cost_assignment
from fwav_companion.tracking.clutter import Clutter, noise_area_px2
from fwav_companion.tracking.lifecycle import is_steady
from fwav_companion.tracking.smoothed.smoothed_track import SmoothedTrack
from fwav_companion.types import GroundFix
from fwav_companion.types.tracks import GateResult

CONFIRMED_BONUS = 8.0
"""Cost advantage of a confirmed track over a tentative one: the tentative track takes a fix from the confirmed one only
if it is fifty times likelier."""
LAST = 1e-3
"""Factor on the cost of a tentative track whose advantage is less than CONFIRMED_BONUS: it takes a fix that is left."""
LEFT = 1e-2
"""Factor on the cost of a steady track that may be out of view, with a fix that is more likely clutter."""

Costs = dict[tuple[int, int], float]
"""The cost of each possible pair, by the id of its track and the index of its fix."""


class TakenFix(msgspec.Struct, frozen=True, gc=False):
    """A fix that a track takes."""

    index: int
    log_likelihood_ratio: float
    """Target against clutter."""
    gate: GateResult


@dataclass
class FramePairs:
    """The possible pairs of a frame."""

    fixes: Sequence[GroundFix]
    against: Clutter
    gates: dict[tuple[int, int], GateResult]
    """By track id and fix index, given the pairs without a rival."""
    alone: dict[tuple[int, int], GateResult]
    """The same, each pair by itself."""
    clutter_llr: list[float]

    def cost(self, track: int, fix: int) -> float:
        """The cost of a pair."""
        gate = self.gates[track, fix]
        return gate.nis + gate.log_det_ratio - self.clutter_llr[fix]

    def llr(self, track: int, fix: int) -> float:
        """Log-likelihood ratio of a fix as one of the track's target, against clutter."""
        most = min(-self.cost(track, fix), self.clutter_llr[fix])
        return 0.5 * (most - self.against.detection_odds)


def label_pairs(tracks: Sequence[SmoothedTrack], fixes: Sequence[GroundFix]) -> Bools:
    """Mask (D, T) of fixes and tracks of one label."""
    labels = [fix.sighting.detection.label for fix in fixes]
    return np.array([[track.label == label for track in tracks] for label in labels], np.bool_)


def frame_pairs(
    fixes: Sequence[GroundFix], prediction: FramePrediction | None, steady: set[int], against: Clutter
) -> FramePairs:
    """The pairs of a prediction. ``steady``: ids of tracks whose pairs may show the frame's displacement."""
    # A detection's pixel noise is the unit of its residual; clutter is compared with all of a fix's own noise.
    own = [2.0 * log(noise_area_px2(fix) / (2.0 * pi * prod(fix.sighting.pixel_sigma))) for fix in fixes]
    clutter_llr = [against.llr_of(fix) + against.detection_odds for fix in fixes]
    if prediction is None:
        return FramePairs(fixes, against, {}, {}, clutter_llr)
    alone = gates = _results(prediction, own)
    if len(prediction.target) > 1:
        certain = prediction.unambiguous(np.array([k in steady for k in prediction.target.tolist()], np.bool_))
        if 0 < len(certain) < len(prediction.target):
            gates = _results(prediction.given(certain), own)
    return FramePairs(fixes, against, gates, alone, clutter_llr)


def _results(prediction: FramePrediction, own: Sequence[float]) -> dict[tuple[int, int], GateResult]:
    rows = zip(
        prediction.detection.tolist(), prediction.target.tolist(), prediction.visible.tolist(),
        prediction.distance2.tolist(), prediction.log_det.tolist(), strict=True,
    )  # fmt: skip
    return {
        (target, fix): GateResult(distance2, log_det - own[fix])
        for fix, target, visible, distance2, log_det in rows
        if visible
    }


def possible_costs(tracks: Sequence[SmoothedTrack], pairs: FramePairs, host_ns: HostNs) -> Costs:
    """The costs of the pairs in the gate. A steady track also takes a fix that is a little more likely clutter, where a
    missed detection is even less likely.
    """
    by_id, costs = {track.id: track for track in tracks}, Costs()
    for (track, fix), gate in pairs.gates.items():
        if track not in by_id or gate.nis >= GATE2:
            continue
        cost = pairs.cost(track, fix)
        if cost < (pairs.against.far_cost if is_steady(by_id[track].life, host_ns) else 0.0):
            costs[track, fix] = cost
    return costs


def assigned(
    tracks: Sequence[SmoothedTrack], costs: Costs, pairs: FramePairs, preferred: set[int],
    sees: Callable[[SmoothedTrack], bool], bonus: Callable[[Costs], Costs],
) -> dict[int, TakenFix]:  # fmt: skip
    """The fix of each track that takes one, by track id.

    ``preferred``: ids of confirmed tracks. ``sees``: whether a track's target is in view. ``bonus``: the costs with the
    evidence of the detector's own ids.
    """
    by_track, by_fix = Counter([i for i, _ in costs]), Counter([j for _, j in costs])
    taken = {i: j for i, j in costs if by_track[i] == by_fix[j] == 1}
    contested = {(i, j): cost for (i, j), cost in costs.items() if i not in taken}
    if contested:
        by_id = {track.id: track for track in tracks}
        seen = {i for i, _ in contested if i in preferred and sees(by_id[i])}
        prior = bonus({
            (i, j): _with_priority(cost, pairs.against.miss_cost, preferred=i in preferred, seen=i in seen)
            for (i, j), cost in contested.items()
        })  # fmt: skip
        taken |= _least(prior)
    found = {}
    for i, j in sorted(taken.items()):
        found[i] = TakenFix(j, pairs.llr(i, j), pairs.alone[i, j])
    return found


def _with_priority(cost: float, miss_cost: float, *, preferred: bool, seen: bool) -> float:
    """The cost with the priority of confirmed tracks: a target in view without a fix was missed."""
    if not preferred:
        return min(cost + CONFIRMED_BONUS, LAST * cost)
    if seen:
        return cost - miss_cost
    return LEFT * (cost - miss_cost) if cost > 0.0 else cost


def _least(costs: Costs) -> dict[int, int]:
    """The pairs of least total cost. A track may stay without a fix at no cost."""
    rows = sorted({i for i, _ in costs})
    by_row: dict[int, dict[int, float]] = {i: {-1 - k: 0.0} for k, i in enumerate(rows)}
    for (i, j), cost in costs.items():
        by_row[i][j] = cost
    chosen = least_cost_assignment([by_row[i] for i in rows])
    return {i: j for i, j in zip(rows, chosen, strict=True) if j >= 0}
