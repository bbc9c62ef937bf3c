"""One update of the static-target filter, with all considered biases, in plain scalars.

Two comparisons: with the same filter in plain numpy (``plain_filter``), and with the bare step of filterpy's filter
over one state of the target's position and the biases of a flight over level ground, its matrices constant.
``python -m tests.benchmarks.filter_update``

filterpy's step is about twenty calls of numpy, each about a microsecond for any size of the state. A tenth of that is
the number of bytecodes that reads each bias a few times. Delaying the work (information form, evaluated on demand)
saves nothing: a tracker evaluates the state in every frame to associate the next fix. numpy itself would add 16 MiB to
the daemon's memory, and is not faster at this size.
"""

from __future__ import annotations

import numpy as np
from filterpy.kalman import KalmanFilter
from msgspec.structs import replace

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.localization import HomeGround, Localizer
from fwav_companion.tracking.filters.kalman import StaticKalman, StaticTargetState
from fwav_companion.types import Bias, ErrorPriors, GroundFix
from tests.benchmarks.figure import Figure, interleaved
from tests.benchmarks.fix import DEFAULTS, a_sighting
from tests.benchmarks.plain_filter import FixArrays, PlainFilter

LEVEL = replace(DEFAULTS, bias_sigmas=tuple(0.0 if bias is Bias.TERRAIN else DEFAULTS.sigma(bias) for bias in Bias))
"""Priors over a ground without an elevation model, the usual case."""
SHARED = sum(sigma > 0.0 for sigma in LEVEL.bias_sigmas)
FIXES = 300
FRAME_NS = NS_PER_S // 30
SCATTER_M = 0.3
BUDGET = 3.0
"""A filter of six states and thirteen biases; the one that ten was written for had two and eleven."""


def fixes() -> list[GroundFix]:
    """Scattered fixes of one target, thirty a second."""
    fix = Localizer(HomeGround(), LEVEL, min_height_m=0.5).locate(a_sighting())
    assert isinstance(fix, GroundFix)
    rng, (north, east, down) = np.random.default_rng(1), fix.position_ned
    reported = []
    for k, (n, e) in enumerate(rng.normal(0.0, SCATTER_M, (FIXES, 2)).tolist()):
        at = HostNs(k * FRAME_NS)
        sighting = replace(fix.sighting, frame_host_ns=at, host_ns=at)
        reported.append(replace(fix, sighting=sighting, position_ned=(north + n, east + e, down)))
    return reported


def estimated(reported: list[GroundFix], priors: ErrorPriors) -> StaticTargetState:
    """The state after all fixes, by our filter."""
    state = StaticKalman(priors).initiate(reported[0])
    for fix in reported[1:]:
        state = state.predict(fix.sighting.frame_host_ns).update(fix)
    return state


def plainly_estimated(reported: list[FixArrays], priors: ErrorPriors) -> PlainFilter:
    """The state after all fixes, in plain numpy."""
    plain = PlainFilter(reported[0], priors)
    for fix in reported[1:]:
        plain.step(fix)
    return plain


def measure() -> list[Figure]:
    """The ratios of CPU times."""
    reported = fixes()
    arrays = [FixArrays(fix, LEVEL) for fix in reported]
    observed = np.hstack([np.eye(2), arrays[0].shared[:, :SHARED]])

    def bare() -> None:
        kalman = KalmanFilter(dim_x=2 + SHARED, dim_z=2)
        kalman.H, kalman.R, kalman.Q = observed, arrays[0].noise, 1e-9 * np.eye(2 + SHARED)
        for fix in arrays[1:]:
            kalman.predict()
            kalman.update(fix.position)

    ours_s, same_s, bare_s = interleaved(
        lambda: estimated(reported, LEVEL), lambda: plainly_estimated(arrays, LEVEL), bare
    )
    ours = f"ours {ours_s / FIXES * 1e6:.1f} us"
    return [
        Figure(f"one update of a single-target filter, against {name}", seconds / ours_s, BUDGET, True, detail)
        for name, seconds, detail in (
            (
                "the same filter in plain numpy",
                same_s,
                f"{ours}, numpy {same_s / FIXES * 1e6:.0f} us",
            ),
            ("filterpy's bare step", bare_s, f"{ours}, filterpy {bare_s / FIXES * 1e6:.0f} us"),
        )
    ]


if __name__ == "__main__":
    print(*measure(), sep="\n")
