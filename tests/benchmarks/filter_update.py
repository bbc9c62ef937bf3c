"""One fix taken by the filter of a standing target, with all that fixes share, against filterpy with as many states.

filterpy's filter holds the target's place and the eleven biases of a flight over level ground in one state, which is
the plain way to know what fixes have in common. ``python -m tests.benchmarks.filter_update``

Ten times as fast is not to be had in Python. filterpy's step is some twenty calls of numpy, each about a microsecond
whatever the size of the state. A tenth of that is as many bytecodes as it takes to look at each bias a few times, and
each has to be scaled, faded, weighed against what the target shares with it already, and blended, north and east.
Putting that off (information form, worked out when asked) saves nothing: a tracker asks in every frame, to tell whose
the next fix is. numpy itself would be 16 MiB of a daemon's memory, and no faster at this size than it is there.
"""

from __future__ import annotations

import numpy as np
from filterpy.kalman import KalmanFilter
from msgspec.structs import replace

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.localization import HomeGround, Localizer
from fwav_companion.nouns import Bias, GroundFix
from fwav_companion.tracking.kalman import StaticKalman
from tests.benchmarks.figure import Figure, interleaved
from tests.benchmarks.fix import DEFAULTS, a_sighting

LEVEL = replace(DEFAULTS, bias_sigmas=(*DEFAULTS.bias_sigmas[: Bias.TERRAIN], 0.0))
"""Of a ground that is no elevation model, as most are."""
SHARED = sum(sigma > 0.0 for sigma in LEVEL.bias_sigmas)
FIXES = 300
FRAME_NS = NS_PER_S // 30


def fixes() -> list[GroundFix]:
    """Of one target, thirty a second."""
    fix = Localizer(HomeGround(), LEVEL, min_height_m=0.5).locate(a_sighting())
    assert isinstance(fix, GroundFix)
    instants = [HostNs(k * FRAME_NS) for k in range(FIXES)]
    return [replace(fix, sighting=replace(fix.sighting, frame_host_ns=at, host_ns=at)) for at in instants]


def measure() -> list[Figure]:
    """The ratio of CPU times."""
    told = fixes()
    place, noise = np.array(told[0].position_ned), np.array(told[0].noise_cov)
    observed = np.hstack([np.eye(3), np.array(told[0].bias_jacobian[:SHARED]).T])

    def ours() -> None:
        belief = StaticKalman(LEVEL).started(told[0])
        for fix in told[1:]:
            belief = belief.predicted(fix.sighting.frame_host_ns).updated(fix)

    def theirs() -> None:
        kalman = KalmanFilter(dim_x=3 + SHARED, dim_z=3)
        kalman.H, kalman.R, kalman.Q = observed, noise + 1e-9 * np.eye(3), 1e-9 * np.eye(3 + SHARED)
        for _ in told[1:]:
            kalman.predict()
            kalman.update(place)

    ours_s, theirs_s = interleaved(ours, theirs)
    detail = f"ours {ours_s / FIXES * 1e6:.1f} us, filterpy {theirs_s / FIXES * 1e6:.0f} us"
    return [Figure("one update of a single-target filter, against filterpy", theirs_s / ours_s, 10.0, True, detail)]


if __name__ == "__main__":
    print(*measure(), sep="\n")
