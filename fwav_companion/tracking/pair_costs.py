"""Costs of those pairs of a track and a fix of one frame that the gates accept.

The cost of a pair is minus twice the log of its likelihood against clutter and a missed detection. Errors that track
and fix share cancel in the gate. Only equal labels form pairs. Ids by the detector are evidence of the
association, not of the gates.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import TypeAlias, cast

import msgspec

from fwav_companion.tracking.clutter import Clutter
from fwav_companion.tracking.coarse_gate import GatedFix, possible_pairs
from fwav_companion.tracking.detector_ids import CERTAIN_TRUST
from fwav_companion.tracking.filters.base import TargetEstimate, TargetState
from fwav_companion.tracking.filters.consider_biases import ConsiderBiases
from fwav_companion.tracking.filters.gates import GATE
from fwav_companion.tracking.filters.standing import StandingTargetState, gates_of
from fwav_companion.types import GroundFix
from fwav_companion.types.tracks import OUTSIDE_GATE, GateResult

Costs: TypeAlias = dict[tuple[int, int], float]
"""The cost of each possible pair, by the indices of its track and its fix."""


class Candidate(msgspec.Struct, frozen=True, gc=False):
    """A track as a candidate for the fixes of a frame."""

    label: str
    target: TargetState
    """Filter state of the track, predicted to the frame."""
    detector_id: int | None
    """The detector's id of the last fix that had one."""
    refined: TargetEstimate | None = None
    """Self-calibrated prediction: more accurate and slower, evaluated only for ambiguous assignments."""
    confirmed: bool = True
    """Whether the track is confirmed, or the branch of a confirmed one."""
    steady: bool = True
    """Whether the track is confirmed and was detected recently, so that its shared errors are those of this frame."""
    id_trust: float = CERTAIN_TRUST
    """Trust in ``detector_id``: twice the log-odds that it is of this target."""


class TracksAndFixes(msgspec.Struct, frozen=True):
    """Tracks and fixes of one frame: at least one track, all with the same filter."""

    candidates: Sequence[Candidate]
    fixes: Sequence[GroundFix]
    clutter_llr: Mapping[int, float]
    """``Clutter.llr_of`` plus ``detection_odds`` of each fix that a track may take, by fix index."""
    against: Clutter

    @property
    def shared_errors(self) -> ConsiderBiases | None:
        """Errors that all targets share; None where the filter gives no sensitivities to them.

        Where they are nonlinear, the wing beat displaces the fixes of each frame differently.
        """
        first = self.candidates[0].target
        if not all(isinstance(candidate.target, StandingTargetState) for candidate in self.candidates):
            return None  # a moving target has none; the smoother's gates are already joint ones
        return cast("StandingTargetState", first).model.errors

    def cost(self, i: int, j: int, gated: GateResult, *, gate: float = GATE) -> float | None:
        """The cost of candidate i with fix j, lower is better; None outside the gate.

        A steady track also takes a fix that is more likely clutter, if a missed detection is even less likely.
        """
        cost = gated.nis + gated.log_det_ratio - self.clutter_llr[j]
        most = self.against.far_cost if self.candidates[i].steady else 0.0
        return cost if gated.nis < gate and cost < most else None

    def standing(self, i: int) -> StandingTargetState:
        """The target of candidate i in a jointly gated frame, in which all targets are static."""
        return cast("StandingTargetState", self.candidates[i].target)


def possible_costs(
    candidates: Sequence[Candidate], fixes: Sequence[GroundFix], against: Clutter
) -> tuple[TracksAndFixes, Costs]:
    """The tracks and fixes of a frame, and the costs of the pairs that the gates accept."""
    possible, clutter_llr = _possible(candidates, fixes, against)
    frame = TracksAndFixes(candidates, fixes, clutter_llr, against)
    return frame, _refined(_costs(possible, frame), frame)


def _possible(
    candidates: Sequence[Candidate], fixes: Sequence[GroundFix], against: Clutter
) -> tuple[dict[int, list[int]], dict[int, float]]:
    """The fixes of equal label, in order, that each candidate may take; and the ``clutter_llr`` of those fixes.

    The covariance of an innovation is never smaller than that of its fix. So the cost is positive wherever the NIS
    exceeds ``clutter_llr``.
    """
    targets: defaultdict[str, list[tuple[int, TargetState]]] = defaultdict(list)
    for i, candidate in enumerate(candidates):
        targets[candidate.label].append((i, candidate.target))
    clutter_llr: dict[int, float] = {}
    by_label: defaultdict[str, list[GatedFix]] = defaultdict(list)
    for j, fix in enumerate(fixes):
        detection = fix.sighting.detection
        if detection.label in targets:
            llr = clutter_llr[j] = against.llr_of(fix) + against.detection_odds
            gate = max(0.0, min(GATE, llr + against.far_cost))
            by_label[detection.label].append((j, fix, gate))
    possible: dict[int, list[int]] = {}
    for label, of_label in by_label.items():
        possible |= possible_pairs(targets[label], of_label)
    return possible, clutter_llr


def _costs(possible: Mapping[int, Sequence[int]], frame: TracksAndFixes) -> Costs:
    """The costs of the pairs that the gates accept."""
    costs: Costs = {}
    for i, near in possible.items():
        for j, gated in zip(near, gates_of(frame.candidates[i].target, [frame.fixes[j] for j in near]), strict=True):
            cost = None if gated is OUTSIDE_GATE else frame.cost(i, j, gated)
            if cost is not None:
                costs[i, j] = cost
    return costs


def unambiguous_pairs(costs: Costs) -> dict[int, int]:
    """The pairs without another partner of track or fix, in the order of the costs: fix index by candidate index."""
    pairs = dict(costs.keys())
    if len(pairs) == len(set(pairs.values())) == len(costs):  # as in most frames
        return pairs
    rows, columns = Counter([i for i, _ in costs]), Counter([j for _, j in costs])
    return {i: j for i, j in costs if rows[i] == columns[j] == 1}


def _refined(costs: Costs, frame: TracksAndFixes) -> Costs:
    """The costs, by the self-calibrated prediction where a track or a fix has more than one partner."""
    if not [candidate for candidate in frame.candidates if candidate.refined is not None]:
        return costs
    alone, refined = unambiguous_pairs(costs), Costs()
    for (i, j), coarse in costs.items():
        target = frame.candidates[i].refined
        cost = coarse if target is None or i in alone else frame.cost(i, j, target.gate(frame.fixes[j]))
        if cost is not None:
            refined[i, j] = cost
    return refined
