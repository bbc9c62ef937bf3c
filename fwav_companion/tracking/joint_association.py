"""Joint gating of a frame: unambiguous pairs show the errors that all targets share, which excludes other pairs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Container, Mapping, Sequence

from fwav_companion.tracking.joint_compatibility import JointGate
from fwav_companion.tracking.pair_costs import Candidate, Costs, TracksAndFixes, unambiguous_pairs

SURE = -6.0
"""Largest cost of a pair that shows the common biases although its track is not steady: odds of 20 to 1."""
JOINT_GATE = 13.8
"""Gate on the normalised innovation squared given the biases that other pairs show, 2 degrees of freedom: a true
measurement exceeds it once in 1000 times."""
ROUNDS = 3
"""Maximum number of rounds that narrow the gates."""
RIVAL = 6.0
"""Cost difference below which the second-best pair of a track or a fix rivals the best one: odds of 20 to 1."""
MOST_PAIRS = 400
"""Number of pairs up to which a frame is gated jointly. Measured: a pair takes 18 us. Flights over thirty targets have
at most 31 pairs; 256 new targets over 50 by 36 m have a thousand."""


def doubtful_fixes(costs: Costs, frame: TracksAndFixes) -> set[int]:
    """Indices of the fixes in doubt: those of pairs with a rival, and those that a track that is not steady may take.

    There are none unless the tracks have sensitivities to the shared errors, and these errors act linearly.
    """
    if not 2 <= len(costs) <= MOST_PAIRS:
        return set()
    errors = frame.shared_errors
    if errors is None or errors.nonlinear:
        return set()
    return _rivals(costs, frame) | {j for i, j in costs if not frame.candidates[i].steady}


def jointly_gated(costs: Costs, frame: TracksAndFixes, joint: JointGate, doubtful: Container[int]) -> Costs:
    """The costs after joint gating: unambiguous pairs exclude other pairs, which makes further pairs unambiguous.

    ``doubtful``: the fixes whose gates are narrowed. A pair that is more likely clutter is not learned.
    """
    candidates = frame.candidates

    def joint_cost(i: int, j: int) -> float | None:
        if candidates[i].refined is not None or j not in doubtful:
            return costs[i, j]
        return frame.cost(i, j, joint.gate(frame.standing(i), frame.fixes[j]), gate=JOINT_GATE)

    gated_after = None
    for _ in range(ROUNDS):
        for i, j in _unambiguous(costs, candidates):
            beyond_doubt = candidates[i].steady and costs[i, j] < 0.0
            if beyond_doubt or (joint_cost(i, j) or 0.0) <= SURE:
                joint.learn(frame.standing(i), frame.fixes[j], steady=candidates[i].steady)
        if joint.pairs == gated_after:
            break
        gated_after = joint.pairs
        before, costs = costs, {pair: cost for pair in costs if (cost := joint_cost(*pair)) is not None}
        if len(costs) == len(before):
            break
    return costs


def learn_decided(taken: Mapping[int, int], costs: Costs, frame: TracksAndFixes, joint: JointGate) -> None:
    """Learn from the pairs of tracks that are not steady, after all pairs are decided.

    ``taken``: fix index of each track, by candidate index.
    """
    for i, j in taken.items():
        candidate = frame.candidates[i]
        if candidate.confirmed and not candidate.steady and costs[i, j] <= SURE:
            joint.learn(frame.standing(i), frame.fixes[j], steady=False)


def _rivals(costs: Costs, frame: TracksAndFixes) -> set[int]:
    """Indices of the fixes of pairs that are about as likely as another pair of the same track or fix.

    Errors beyond their priors, such as a camera delay larger than its prior allows, displace steady tracks too, by as
    much as the distance between targets. Self-calibrated predictions are left out: their errors are known.
    """
    pairs: defaultdict[tuple[str, int], list[tuple[float, int]]] = defaultdict(list)
    for (i, j), cost in costs.items():
        if frame.candidates[i].refined is not None:
            continue
        pairs["track", i].append((cost, j))
        pairs["fix", j].append((cost, j))
    fixes = set[int]()
    for (least, one), (more, other), *_ in (sorted(each) for each in pairs.values() if len(each) > 1):
        if more - least < RIVAL:
            fixes |= {one, other}
    return fixes


def _unambiguous(costs: Costs, candidates: Sequence[Candidate]) -> list[tuple[int, int]]:
    """The pairs of confirmed tracks without another partner: those of steady tracks first, then by cost."""
    alone = [pair for pair in unambiguous_pairs(costs).items() if candidates[pair[0]].confirmed]
    return sorted(alone, key=lambda pair: (not candidates[pair[0]].steady, costs[pair]))
