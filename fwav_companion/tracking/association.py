"""Association of the fixes of a frame with tracks: global nearest neighbour (Blackman & Popoli 1999, ch. 6)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import msgspec

from fwav_companion.geometry.vectors import Vector3
from fwav_companion.tracking.assignment import least_cost_assignment
from fwav_companion.tracking.clutter import Clutter
from fwav_companion.tracking.detector_ids import NO_IDS, IdEvidence, IdTrust
from fwav_companion.tracking.id_association import NO_TRUST, trust_after, with_ids
from fwav_companion.tracking.joint_association import doubtful_fixes, jointly_gated, learn_decided
from fwav_companion.tracking.joint_compatibility import JointGate
from fwav_companion.tracking.pair_costs import Candidate, Costs, TracksAndFixes, possible_costs, unambiguous_pairs
from fwav_companion.types import GroundFix

CONFIRMED_BONUS = 8.0
"""Cost advantage of a confirmed track over a tentative one: the tentative track takes a fix from the confirmed one only
if it is fifty times likelier."""
LAST = 1e-3
"""Factor on the cost of a tentative track whose advantage is less than CONFIRMED_BONUS: it takes a fix that is left."""
LEFT = 1e-2
"""Factor on the cost of a steady track that may be out of view, with a fix that is more likely clutter. It is ten times
LAST, so that the steady track mostly comes before a tentative track."""


class Association(msgspec.Struct, frozen=True):
    """Result of the association of tracks with the fixes of a frame, by candidate index."""

    pairs: Mapping[int, tuple[int, float]]
    """Fix index, each at most once, and the fix's log-likelihood ratio against clutter."""
    id_trust: Mapping[int, IdTrust] = NO_TRUST
    """Trust in the detector's id of that fix; empty where no track has an id."""


def associate(
    candidates: Sequence[Candidate],
    fixes: Sequence[GroundFix],
    against: Clutter,
    could_see: Callable[[Vector3], bool] | None = None,
    joint: JointGate | None = None,
    ids: IdEvidence = NO_IDS,
) -> Association:
    """The association of the fixes of a frame with the tracks.

    ``candidates``: at least one, all with the same filter.
    ``could_see``: whether a place is in view. A target in view without a fix was missed; a target out of view was not.
    Where shared errors displace targets by half the distance between them, this decides which are seen.
    ``ids``: prefers, among pairs that the gates accept, those with the same id by the detector.
    ``joint``: narrows the gates of fixes that more than one track may take, and learns from the pairs.
    """
    frame, costs = possible_costs(candidates, fixes, against)
    doubtful = doubtful_fixes(costs, frame) if joint is not None else ()
    if joint is not None and doubtful:
        costs = jointly_gated(costs, frame, joint, doubtful)
    taken = _taken(costs, frame, could_see, ids)
    if joint is not None and doubtful:
        learn_decided(taken, costs, frame, joint)
    pairs = {i: (j, 0.5 * (min(-costs[i, j], frame.clutter_llr[j]) - against.detection_odds)) for i, j in taken.items()}
    return Association(pairs, trust_after(taken, costs, frame, ids))


def _taken(
    costs: Costs, frame: TracksAndFixes, could_see: Callable[[Vector3], bool] | None, ids: IdEvidence
) -> dict[int, int]:
    """Fix index of each track that takes a fix, by candidate index."""
    alone = unambiguous_pairs(costs)  # taken: they cost less than a miss
    if len(alone) == len(costs):
        return alone
    contested = {(i, j): cost for (i, j), cost in costs.items() if i not in alone}
    prior = with_ids(_with_priority(_with_misses(contested, frame, could_see), frame), frame, ids)
    return dict(sorted([*_assigned(prior).items(), *alone.items()]))


def _with_misses(costs: Costs, frame: TracksAndFixes, could_see: Callable[[Vector3], bool] | None) -> Costs:
    """The costs, less the cost of a missed detection for confirmed tracks in view.

    A tentative track may be clutter; without a fix, then no target was missed. A steady track that may be beyond the
    image's edge takes a fix that is left.
    """
    miss_cost, candidates = frame.against.miss_cost, frame.candidates
    if could_see is None or miss_cost <= 0.0:
        return costs
    rows = {i for i, _ in costs if candidates[i].confirmed}
    seen = {i for i in rows if could_see(candidates[i].target.apparent_ned)}
    return {
        (i, j): cost - miss_cost if i in seen else LEFT * (cost - miss_cost) if cost > 0.0 else cost
        for (i, j), cost in costs.items()
    }


def _with_priority(costs: Costs, frame: TracksAndFixes) -> Costs:
    """The costs with priority for confirmed tracks.

    Tentative tracks have a handicap, but may take a fix that no confirmed track takes. Where the errors are not linear,
    distances are weaker evidence than the presence of all targets. There, confirmed tracks have a reward instead, so
    that as many of them as possible have a fix. In 24 flights over near targets with a late camera, the handicap loses
    or duplicates a target in three flights, the reward in none. One rule for both cases, the odds that a track exists
    and is detected, does so in one. It also does so in six of sixty flights over thirty targets, the handicap in four.
    """
    confirmed, errors = [candidate.confirmed for candidate in frame.candidates], frame.shared_errors
    if errors is not None and errors.nonlinear:
        return {(i, j): cost - CONFIRMED_BONUS * confirmed[i] for (i, j), cost in costs.items()}
    return {
        (i, j): cost if confirmed[i] else min(cost + CONFIRMED_BONUS, LAST * cost) for (i, j), cost in costs.items()
    }


def _assigned(costs: Costs) -> dict[int, int]:
    """The pairs of least total cost. A track may stay without a fix at no cost."""
    rows = sorted({i for i, _ in costs})
    by_row: dict[int, dict[int, float]] = {i: {-1 - i: 0.0} for i in rows}
    for (i, j), cost in costs.items():
        by_row[i][j] = cost
    chosen = least_cost_assignment([by_row[i] for i in rows])
    return {i: j for i, j in zip(rows, chosen, strict=True) if j >= 0}
