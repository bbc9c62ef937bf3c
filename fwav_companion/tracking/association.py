"""Which fix of a frame is which target.

Distances are weighed without the errors that belief and fix share (they move both alike), labels are kept apart, a
detector's own id is believed as long as it is not absurd, and the rest is settled at the least total cost.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import msgspec

from fwav_companion.tracking.assignment import least_cost_assignment
from fwav_companion.tracking.filters.base import TargetState
from fwav_companion.tracking.filters.gates import GATE, ID_GATE
from fwav_companion.types import GroundFix

CLUTTER_LLR = 20.0
"""Distance and spread together, beyond which a fix is likelier a false one than this target's: with one false detection
in ten frames of 640 x 480 pixels and 4 px of noise, 2 log(640 * 480 / (0.1 * 2 pi * 16)). So a track that is hardly
known where cannot take whatever comes."""


CONFIRMED_BONUS = 8.0
"""Of a believed track over a newborn: the newborn must be likelier by this, fifty to one, to take the fix from it."""


class Candidate(msgspec.Struct, frozen=True):
    """What association must know of a track."""

    label: str
    belief: TargetState
    """Predicted to the frame."""
    detector_id: int | None
    """The detector's id of the last fix it took."""
    closer: TargetState | None = None
    """A second, sharper and dearer, opinion, asked where the first leaves a choice."""
    believed: bool = True
    """It comes before a newborn that wants the same fix, unless the newborn is much the likelier of the two."""


def associate(candidates: Sequence[Candidate], fixes: Sequence[GroundFix]) -> dict[int, tuple[int, float]]:
    """Candidate index -> fix index, each at most once, and how much likelier than a false one it is (a logarithm)."""
    costs: dict[tuple[int, int], float] = {}
    for j, fix in enumerate(fixes):
        label = fix.sighting.detection.label
        for i, candidate in enumerate(candidates):
            if candidate.label == label:
                cost = _cost(candidate, candidate.belief, fix)
                if cost is not None:
                    costs[i, j] = cost
    costs = _looked_at_closer(costs, candidates, fixes)
    ranked = {(i, j): cost - CONFIRMED_BONUS * candidates[i].believed for (i, j), cost in costs.items()}
    return {i: (j, -0.5 * max(costs[i, j], -CLUTTER_LLR)) for i, j in _settled(ranked).items()}


def _looked_at_closer(
    costs: dict[tuple[int, int], float], candidates: Sequence[Candidate], fixes: Sequence[GroundFix]
) -> dict[tuple[int, int], float]:
    """The same, by the sharper opinion wherever a track or a fix has more than one partner to choose from."""
    rows, columns = Counter(i for i, _ in costs), Counter(j for _, j in costs)
    closer: dict[tuple[int, int], float] = {}
    for (i, j), first_cost in costs.items():
        belief = candidates[i].closer
        chosen = rows[i] == 1 and columns[j] == 1
        cost = first_cost if belief is None or chosen else _cost(candidates[i], belief, fixes[j])
        if cost is not None:
            closer[i, j] = cost
    return closer


def _cost(candidate: Candidate, belief: TargetState, fix: GroundFix) -> float | None:
    """Negative, the lower the better; None: not this one."""
    seen = belief.gate(fix)
    detector_id = fix.sighting.detection.detector_id
    if detector_id is not None and detector_id == candidate.detector_id:
        return seen.nis - 2.0 * ID_GATE if seen.nis < ID_GATE else None
    unlikely = seen.nis + seen.log_det_ratio
    return unlikely - CLUTTER_LLR if seen.nis < GATE and unlikely < CLUTTER_LLR else None


def _settled(costs: dict[tuple[int, int], float]) -> dict[int, int]:
    """The least total cost, where staying alone costs nothing."""
    if not costs:
        return {}
    rows = sorted({i for i, _ in costs})
    columns = sorted({j for _, j in costs})
    if len(rows) == len(columns) == len(costs):  # nobody has a choice
        return dict(costs.keys())
    table = [[costs.get((i, j), 0.0) for j in columns] + [0.0] * len(rows) for i in rows]
    chosen = least_cost_assignment(table)
    pairs = ((row, columns[c]) for row, c in zip(rows, chosen, strict=True) if c < len(columns))
    return {i: j for i, j in pairs if (i, j) in costs}
