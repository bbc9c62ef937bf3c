"""Gating statistics of many fixes against one point: normalised innovation squared, and log determinant ratio.

Every frame needs them for each pair of a track and a fix, so fixes that one axis alone excludes are rejected first.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import dist, log

from fwav_companion.tracking.filters.adaptive_noise import AdaptiveNoise
from fwav_companion.tracking.filters.consider_biases import Measurement
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate
from fwav_companion.types.tracks import OUTSIDE_GATE, GateResult


def gate_results(
    estimate: PointEstimate, scatter: AdaptiveNoise, fixes: Sequence[Measurement], timed: int | None
) -> list[GateResult]:
    """Gating statistics of fixes; errors shared with the estimate cancel. ``timed``: index of the time offset."""
    (own_n, own_e), (p_nn, p_ne, p_ee) = estimate.shared, estimate.noise
    north_m, east_m, certain = estimate.north_m, estimate.east_m, 1.0 - scatter.doubt
    p_nn, p_ee, own2 = p_nn + scatter.variance, p_ee + scatter.variance, dist(own_n, own_e) ** 2
    results = []
    for fix in fixes:
        (fix_n, fix_e, _), ((f_nn, f_ne, _), (_, f_ee, _), _) = fix.shared, fix.noise
        n, e, nn = fix.position[0] - north_m, fix.position[1] - east_m, p_nn + f_nn + dist(fix_n, own_n) ** 2
        if n * n > fix.gate * nn:  # the distance along either axis is a lower bound
            results.append(OUTSIDE_GATE)
            continue
        ee = p_ee + f_ee + dist(fix_e, own_e) ** 2
        if e * e > fix.gate * ee:
            results.append(OUTSIDE_GATE)
            continue
        by_ne = 0.5 * (dist(fix_n, own_e) ** 2 + dist(fix_e, own_n) ** 2 - dist(fix_n, fix_e) ** 2 - own2)
        ne = p_ne + f_ne + by_ne  # the inner product of the differences, by the distances of their ends
        if timed is not None:
            north, east = fix_n[timed] - own_n[timed], fix_e[timed] - own_e[timed]
            nn, ne, ee = nn - certain * north * north, ne - certain * north * east, ee - certain * east * east
        area2 = nn * ee - ne * ne
        nis = (ee * n * n - 2.0 * ne * n * e + nn * e * e) / area2
        results.append(GateResult(nis, log(area2 / (f_nn * f_ee - f_ne * f_ne))))
    return results
