"""Use of the detector's ids in the association of one frame: the bonus of a pair, and the trust after it. PURE."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Mapping, Sequence
from typing import Final

from fwav_companion.tracking.detector_ids import CERTAIN, CERTAIN_TRUST, IdEvidence, IdTrust
from fwav_companion.tracking.pair_costs import Costs, TracksAndFixes
from fwav_companion.types import GroundFix

NO_TRUST: Final[dict[int, IdTrust]] = {}


def with_ids(costs: Costs, frame: TracksAndFixes, ids: IdEvidence) -> Costs:
    """The costs, less the bonus of pairs whose track and fix have one id; an id that occurs twice is none.

    Where two such pairs may be exchanged, the exchange is one event, of which each counts half. Where one fix has the
    choice, no second place contradicts the id later, so only the persistence of ids counts.
    """
    own = _unique([candidate.detector_id for candidate in frame.candidates])
    of_fix = _unique([fix.sighting.detection.detector_id for fix in frame.fixes])
    if not own or not of_fix:
        return costs
    same = {i: j for i, j in costs if i in own and own[i] == of_fix.get(j)}
    fixes_of, tracks_of = defaultdict[int, list[int]](list), defaultdict[int, list[int]](list)
    for i, j in costs:
        fixes_of[i].append(j)
        tracks_of[j].append(i)
    found = dict(costs)
    for i, j in same.items():
        trust = frame.candidates[i].id_trust
        if any(k != i and (i, same.get(k)) in costs for k in tracks_of[j]):
            most = ids.most_trust(_least_separation2(j, fixes_of[i], frame), _averaged(i, j, frame))
            found[i, j] -= 0.5 * min(trust, most)
        else:
            found[i, j] -= min(trust, ids.most_trust(0.0))
    return found


def trust_after(taken: Mapping[int, int], costs: Costs, frame: TracksAndFixes, ids: IdEvidence) -> dict[int, IdTrust]:
    """The trust of each track that took a fix in the id of that fix, by candidate index; empty without ids.

    ``costs``: those of the places alone.
    """
    for candidate in frame.candidates:
        if candidate.detector_id is not None:
            break
    else:
        return NO_TRUST
    rivals = defaultdict[int, list[int]](list)
    for k, j in costs:
        if k in taken:
            rivals[j].append(k)
    return {i: _trust(i, taken, rivals[j], costs=costs, frame=frame, ids=ids) for i, j in taken.items()}


def _trust(
    i: int,
    taken: Mapping[int, int],
    of_fix: Sequence[int],
    *,
    costs: Costs,
    frame: TracksAndFixes,
    ids: IdEvidence,
) -> IdTrust:
    """The trust of one track. ``of_fix``: the tracks that may take its fix and took one."""
    j = taken[i]
    own, now = frame.candidates[i].detector_id, frame.fixes[j].sighting.detection.detector_id
    rivals = [(k, taken[k]) for k in of_fix if k != i and (i, taken[k]) in costs]
    if not rivals:
        return CERTAIN
    # The places' evidence for this pair: the cost of the nearest exchange, less that of what was taken.
    by_place, k, m = min((costs[i, m] + costs[k, j] - costs[i, j] - costs[k, m], k, m) for k, m in rivals)
    most = ids.most_trust(_separation2(frame.fixes[j], frame.fixes[m]), _averaged(i, j, frame))
    before = min(frame.candidates[i].id_trust, most)
    if own is None or now is None:
        before = 0.0
    elif own != now:
        before = -before if frame.candidates[k].detector_id == now else 0.0
    return IdTrust(min(CERTAIN_TRUST, max(0.0, before + by_place)), met=most < CERTAIN_TRUST)


def _unique(numbers: Collection[int | None]) -> dict[int, int]:
    """The ids that occur once, by index."""
    counts = Counter(numbers)
    return {i: number for i, number in enumerate(numbers) if number is not None and counts[number] == 1}


def _least_separation2(j: int, others: Collection[int], frame: TracksAndFixes) -> float:
    """The smallest separation of a fix from other fixes that its track may take; 0 where it is alone."""
    return min((_separation2(frame.fixes[j], frame.fixes[m]) for m in others if m != j), default=0.0)


def _averaged(i: int, j: int, frame: TracksAndFixes) -> float:
    """The number of fixes over which a track averages: the variance of a fix's noise over that of the track."""
    noise, own = frame.fixes[j].noise_cov, frame.candidates[i].target.relative_cov
    track2 = own[0][0] + own[1][1]
    return (noise[0][0] + noise[1][1]) / track2 if track2 > 0.0 else 1.0


def _separation2(one: GroundFix, other: GroundFix) -> float:
    """The squared distance of two fixes, d^T (N1 + N2)^-1 d with their noise covariances, horizontally."""
    n = one.position_ned[0] - other.position_ned[0]
    e = one.position_ned[1] - other.position_ned[1]
    nn = one.noise_cov[0][0] + other.noise_cov[0][0]
    ne = one.noise_cov[0][1] + other.noise_cov[0][1]
    ee = one.noise_cov[1][1] + other.noise_cov[1][1]
    determinant = nn * ee - ne * ne
    return (n * n * ee - 2.0 * n * e * ne + e * e * nn) / determinant if determinant > 0.0 else 0.0
