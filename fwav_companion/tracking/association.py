"""Association of the fixes of a frame with tracks: global nearest neighbour (Blackman & Popoli 1999, ch. 6).

The cost of a pair is minus twice the log of its likelihood against clutter and a missed detection. Errors that track
and fix share cancel in the gate. Labels are kept apart; a detector's own id counts while the fix is not absurdly far.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from math import dist, log, pi, sqrt
from typing import cast

import msgspec

from fwav_companion.geometry.vectors import Vector3, cross, norm
from fwav_companion.tracking.assignment import least_cost_assignment
from fwav_companion.tracking.coarse_gate import GatedFix, possible_pairs
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.filters.base import TargetEstimate, TargetState
from fwav_companion.tracking.filters.gates import GATE, ID_GATE
from fwav_companion.tracking.filters.standing import StandingTargetState, gates_of
from fwav_companion.tracking.joint_compatibility import JointGate
from fwav_companion.types import GroundFix
from fwav_companion.types.tracks import OUTSIDE_GATE, GateResult

CONFIRMED_BONUS = 8.0
"""Advantage of a confirmed track over a tentative one: the latter must be likelier by this, fifty to one, to take the
fix from it."""
LAST = 1e-3
"""Share of the cost of a tentative track that is less than that: it takes a fix that is left."""
LEFT = 1e-2
"""The same of a steady track that may be out of view and a fix that is more likely clutter: ten times as much, so that
it mostly comes before a tentative track."""
MOST_FALSE = 1.0
"""False detections a frame up to which a steady track takes a fix that is more likely clutter. A track of clutter would
live on them: at three a frame one lived for 25 s of 60."""
SURE = -6.0
"""Cost of a pair that shows the common biases although its track coasted: odds of 20 to 1."""
JOINT_GATE = 13.8
"""The gate given what other pairs show; 2 degrees of freedom: a true fix lies beyond it once in 1000 times."""
ROUNDS = 3
"""Rounds of narrowing gates, at most."""
MOST_PAIRS = 400
"""Pairs up to which a frame is gated jointly. Measured: a pair takes 18 us, and flights over thirty targets have 31 at
most; 256 new targets over 50 by 36 m have a thousand."""
LEAST_NOISE_PX2 = 1e-3
"""Lower bound of a fix's noise ellipse, square pixels: a detection that claims less is not believed."""


class Candidate(msgspec.Struct, frozen=True, gc=False):
    """A track as association sees it."""

    label: str
    target: TargetState
    """Predicted to the frame."""
    detector_id: int | None
    """The detector's id of the track's last fix."""
    refined: TargetEstimate | None = None
    """Self-calibrated prediction: more accurate and slower, evaluated only for ambiguous assignments."""
    confirmed: bool = True
    """Whether the track is confirmed, or the branch of a confirmed one."""
    steady: bool = True
    """Whether the track is confirmed and was detected in the last frames: its errors are those of this one."""


class Clutter(msgspec.Struct, frozen=True):
    """Log-likelihoods that a fix is compared with."""

    false_per_px2: float
    """False detections of a frame per square pixel."""
    detection_odds: float
    """Twice the log of the odds of a detection over a missed one, 0 at most."""
    miss_cost: float = 0.0
    """The same odds, 0 at least: cost of a target in view that stays without a fix."""
    far_cost: float = 0.0
    """Cost below which a steady track takes a fix: that of a miss where false detections are rare."""

    def llr_of(self, fix: GroundFix) -> float:
        """CLUTTER_LLR of a fix: NIS plus log determinant ratio at which target and clutter are equally likely."""
        return -2.0 * log(self.false_per_px2 * noise_area_px2(fix))


def clutter(detector: DetectorModel, image_px2: float) -> Clutter:
    """The clutter of a frame. ``image_px2``: area of the image, square pixels."""
    probability = detector.detection_probability
    odds = 2.0 * log(probability / (1.0 - probability))
    false, miss_cost = detector.false_per_frame, max(0.0, odds)
    return Clutter(false / image_px2, min(0.0, odds), miss_cost, miss_cost if false <= MOST_FALSE else 0.0)


def noise_area_px2(fix: GroundFix) -> float:
    """2 pi sqrt(det R) of the fix's horizontal noise, in square pixels of its image.

    A square pixel covers ``|d_du x d_dv| r^3 / h`` of level ground, at the slant range r from the height h.
    """
    (nn, ne, _), (_, ee, _), _ = fix.noise_cov
    sighting, ray = fix.sighting, fix.sighting.ray
    range_m, height_m = dist(fix.position_ned, sighting.camera_ned), fix.position_ned[2] - sighting.camera_ned[2]
    ground_per_px2 = norm(cross(ray.d_du, ray.d_dv)) * range_m * range_m * range_m / max(abs(height_m), 1e-3)
    return max(LEAST_NOISE_PX2, 2.0 * pi * sqrt(max(0.0, nn * ee - ne * ne)) / ground_per_px2)


class _Frame(msgspec.Struct, frozen=True):
    """Tracks and fixes of a frame."""

    candidates: Sequence[Candidate]
    fixes: Sequence[GroundFix]
    clutter_llr: Mapping[int, float]
    """CLUTTER_LLR of the fixes that a track may take, by index."""
    against: Clutter

    def cost(self, i: int, j: int, gated: GateResult, *, gate: float = GATE) -> float | None:
        """The cost of candidate i with fix j, the lower the better; None outside the gate.

        A steady track takes a fix that is more likely clutter, too, where a missed detection is less likely still.
        """
        detector_id = self.fixes[j].sighting.detection.detector_id
        if detector_id is not None and detector_id == self.candidates[i].detector_id:
            return gated.nis - 2.0 * ID_GATE if gated.nis < ID_GATE else None
        cost = gated.nis + gated.log_det_ratio - self.clutter_llr[j]
        most = self.against.far_cost if self.candidates[i].steady else 0.0
        return cost if gated.nis < gate and cost < most else None

    def standing(self, i: int) -> StandingTargetState:
        """The target of candidate i in a frame that is gated jointly: all of them stand."""
        return cast("StandingTargetState", self.candidates[i].target)


def associate(
    candidates: Sequence[Candidate],
    fixes: Sequence[GroundFix],
    against: Clutter,
    could_see: Callable[[Vector3], bool] | None = None,
    joint: JointGate | None = None,
) -> dict[int, tuple[int, float]]:
    """Candidate index -> fix index, each at most once, and the log-likelihood ratio of that fix against clutter.

    ``candidates``: one at least, all of one filter.
    ``could_see``: whether a place is in view. A target in view that stays without a fix was missed, one out of view was
    not: where errors that targets share move them by half of their distance, this decides which of them are seen.
    ``joint``: narrows the gates of a frame with tracks that are not steady, and learns from the pairs.
    """
    possible, clutter_llr = _possible(candidates, fixes, against)
    frame = _Frame(candidates, fixes, clutter_llr, against)
    costs = _refined(_costs(possible, frame), frame)
    first = candidates[0].target
    nonlinear = isinstance(first, StandingTargetState) and first.nonlinear
    if nonlinear or not 2 <= len(costs) <= MOST_PAIRS or not _is_doubtful([candidates[i] for i, _ in costs]):
        joint = None
    if joint is not None:
        costs = _jointly(costs, frame, joint)
    taken = dict(costs.keys())
    if not len(taken) == len(set(taken.values())) == len(costs):  # a track or a fix has more than one partner
        contested = _contested(costs)
        prior = _with_priority(_with_misses(contested, frame, could_see), frame, nonlinear=nonlinear)
        taken = dict(sorted([*_assigned(prior).items(), *[pair for pair in costs if pair not in contested]]))
    if joint is not None:
        for i, j in taken.items():
            if candidates[i].confirmed and not candidates[i].steady and costs[i, j] <= SURE:
                joint.learn(frame.standing(i), fixes[j], steady=False)
    return {i: (j, 0.5 * (min(-costs[i, j], clutter_llr[j]) - against.detection_odds)) for i, j in taken.items()}


def _possible(
    candidates: Sequence[Candidate], fixes: Sequence[GroundFix], against: Clutter
) -> tuple[dict[int, list[int]], dict[int, float]]:
    """The fixes of equal label, in order, that each candidate may take; and CLUTTER_LLR of those fixes.

    No covariance of an innovation is smaller than the fix's own: beyond CLUTTER_LLR every cost is positive.
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
            gate = max(0.0, min(GATE, llr + against.far_cost)) if detection.detector_id is None else ID_GATE
            by_label[detection.label].append((j, fix, gate))
    possible: dict[int, list[int]] = {}
    for label, of_label in by_label.items():
        possible |= possible_pairs(targets[label], of_label)
    return possible, clutter_llr


def _costs(possible: Mapping[int, Sequence[int]], frame: _Frame) -> dict[tuple[int, int], float]:
    """The costs of the pairs that the gates accept."""
    costs: dict[tuple[int, int], float] = {}
    for i, near in possible.items():
        for j, gated in zip(near, gates_of(frame.candidates[i].target, [frame.fixes[j] for j in near]), strict=True):
            cost = None if gated is OUTSIDE_GATE else frame.cost(i, j, gated)
            if cost is not None:
                costs[i, j] = cost
    return costs


def _refined(costs: dict[tuple[int, int], float], frame: _Frame) -> dict[tuple[int, int], float]:
    """The costs by the self-calibrated prediction wherever a track or a fix has more than one partner."""
    if not [candidate for candidate in frame.candidates if candidate.refined is not None]:
        return costs
    rows, columns = Counter(i for i, _ in costs), Counter(j for _, j in costs)
    refined: dict[tuple[int, int], float] = {}
    for (i, j), coarse in costs.items():
        target = frame.candidates[i].refined
        unambiguous = rows[i] == 1 and columns[j] == 1
        cost = coarse if target is None or unambiguous else frame.cost(i, j, target.gate(frame.fixes[j]))
        if cost is not None:
            refined[i, j] = cost
    return refined


def _is_doubtful(candidates: Sequence[Candidate]) -> bool:
    """Whether a track is not steady, and all have sensitivities to the errors that they share."""
    steady = all(candidate.steady for candidate in candidates)
    return not steady and all(isinstance(candidate.target, StandingTargetState) for candidate in candidates)


def _jointly(costs: dict[tuple[int, int], float], frame: _Frame, joint: JointGate) -> dict[tuple[int, int], float]:
    """The costs given what unambiguous pairs show; what they exclude makes others unambiguous.

    A pair of a steady track is in doubt where another track, which is not steady, may take its fix; one that is more
    likely clutter shows nothing.
    """
    candidates, doubtful = frame.candidates, {j for i, j in costs if not frame.candidates[i].steady}

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


def _unambiguous(costs: Mapping[tuple[int, int], float], candidates: Sequence[Candidate]) -> list[tuple[int, int]]:
    """The pairs of confirmed tracks without another partner: those of steady ones first, then by their costs."""
    rows, columns = Counter(i for i, _ in costs), Counter(j for _, j in costs)
    alone = [(i, j) for i, j in costs if candidates[i].confirmed and rows[i] == columns[j] == 1]
    return sorted(alone, key=lambda pair: (not candidates[pair[0]].steady, costs[pair]))


def _with_misses(
    costs: dict[tuple[int, int], float], frame: _Frame, could_see: Callable[[Vector3], bool] | None
) -> dict[tuple[int, int], float]:
    """The costs less that of a miss, for the confirmed tracks in view.

    A tentative track without a fix may be of clutter: then no target was missed. A steady track that the image's edge
    may hide takes a fix that is left.
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


def _contested(costs: dict[tuple[int, int], float]) -> dict[tuple[int, int], float]:
    """The costs of pairs whose track or fix has another partner. The rest are taken: they cost less than a miss."""
    rows, columns = Counter([i for i, _ in costs]), Counter([j for _, j in costs])
    return {(i, j): cost for (i, j), cost in costs.items() if rows[i] > 1 or columns[j] > 1}


def _with_priority(
    costs: dict[tuple[int, int], float], frame: _Frame, *, nonlinear: bool
) -> dict[tuple[int, int], float]:
    """The costs by which confirmed tracks come first.

    Tentative tracks have a handicap; a fix that no confirmed track takes remains theirs. Where a wing beat displaces
    each frame's fixes in another way (``nonlinear``), distances show less than that all targets are there: a reward of
    confirmed tracks instead, so that as many of them as can be have a fix. Of 24 flights over near targets under a late
    camera the handicap loses or doubles a target in three, the reward in none. One rule for both, the odds that a track
    exists and is detected, does so in one, and in six of sixty over thirty targets, where the handicap does in four.
    """
    confirmed = [candidate.confirmed for candidate in frame.candidates]
    if nonlinear:
        return {(i, j): cost - CONFIRMED_BONUS * confirmed[i] for (i, j), cost in costs.items()}
    return {
        (i, j): cost if confirmed[i] else min(cost + CONFIRMED_BONUS, LAST * cost) for (i, j), cost in costs.items()
    }


def _assigned(costs: dict[tuple[int, int], float]) -> dict[int, int]:
    """The pairs of least total cost, where a pair that is left out costs nothing."""
    rows = sorted({i for i, _ in costs})
    by_row: dict[int, dict[int, float]] = {i: {-1 - i: 0.0} for i in rows}
    for (i, j), cost in costs.items():
        by_row[i][j] = cost
    chosen = least_cost_assignment([by_row[i] for i in rows])
    return {i: j for i, j in zip(rows, chosen, strict=True) if j >= 0}
