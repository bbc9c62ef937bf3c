"""One update of the static-target filter, with all shared biases, against filterpy.

Two comparisons: with the same estimate by filterpy and numpy (``plain_filter``), and with the bare step of filterpy's
filter over one state of the target's position and the eleven biases of a flight over level ground, its matrices
constant. ``python -m tests.benchmarks.filter_update``

Ten times as fast is not possible in Python. filterpy's step is about twenty calls of numpy, each about a microsecond
for any size of the state. A tenth of that is the number of bytecodes that reads each bias a few times, and each bias
has to be scaled, decayed, decorrelated from what the target already shares with it, and updated, north and east: all of
it in one function of scalars still takes 4.3 us. Delaying the work (information form, evaluated on demand) saves
nothing: a tracker evaluates the state in every frame to associate the next fix. Compiled by mypyc the same modules take
two thirds of the time, but every board would need a compiler. numpy itself would add 16 MiB to the daemon's memory, and
is not faster at this size.
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

LEVEL = replace(DEFAULTS, bias_sigmas=(*DEFAULTS.bias_sigmas[: Bias.TERRAIN], 0.0))
"""Priors over a ground without an elevation model, the usual case."""
SHARED = sum(sigma > 0.0 for sigma in LEVEL.bias_sigmas)
FIXES = 300
FRAME_NS = NS_PER_S // 30
SCATTER_M = 0.3
BUDGET = 10.0


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


def believed(reported: list[GroundFix], priors: ErrorPriors) -> StaticTargetState:
    """The state after all fixes, by our filter."""
    belief = StaticKalman(priors).initiate(reported[0])
    for fix in reported[1:]:
        belief = belief.predict(fix.sighting.frame_host_ns).update(fix)
    return belief


def plainly_believed(reported: list[FixArrays], priors: ErrorPriors) -> PlainFilter:
    """The state after all fixes, by filterpy and numpy."""
    plain = PlainFilter(reported[0], priors)
    for fix in reported[1:]:
        plain.step(fix)
    return plain


def measure() -> list[Figure]:
    """The ratios of CPU times."""
    reported = fixes()
    arrays = [FixArrays(fix, LEVEL) for fix in reported]
    observed = np.hstack([np.eye(3), arrays[0].shared[:, :SHARED]])

    def bare() -> None:
        kalman = KalmanFilter(dim_x=3 + SHARED, dim_z=3)
        kalman.H, kalman.R, kalman.Q = observed, arrays[0].noise, 1e-9 * np.eye(3 + SHARED)
        for fix in arrays[1:]:
            kalman.predict()
            kalman.update(fix.position)

    ours_s, same_s, bare_s = interleaved(
        lambda: believed(reported, LEVEL), lambda: plainly_believed(arrays, LEVEL), bare
    )
    ours = f"ours {ours_s / FIXES * 1e6:.1f} us"
    return [
        Figure(f"one update of a single-target filter, against {name}", seconds / ours_s, BUDGET, True, detail)
        for name, seconds, detail in (
            (
                "the same belief by filterpy and numpy",
                same_s,
                f"{ours}, filterpy and numpy {same_s / FIXES * 1e6:.0f} us",
            ),
            ("filterpy's bare step", bare_s, f"{ours}, filterpy {bare_s / FIXES * 1e6:.0f} us"),
        )
    ]


if __name__ == "__main__":
    print(*measure(), sep="\n")
