"""The static filter against filterpy's filter and plain matrices, over fixes that are all different."""

import numpy as np
import pytest
from handmade import a_fix, host_ns
from simulated_flight import priors

from fwav_companion.tracking.filters.kalman import StaticKalman
from fwav_companion.types import BIAS_COUNT, Bias


@pytest.mark.parametrize(("level", "wander_s"), [(True, 60.0), (False, 1e12)])
def test_a_belief_is_what_filterpy_and_numpy_make_of_the_same_fixes(level, wander_s):
    """The decay of a wandering position is kept horizontal only: on a slope it is compared with a filter without
    decay.
    """
    from tests.benchmarks.plain_filter import FixArrays, PlainFilter

    rng = np.random.default_rng(12)
    p = priors(
        roll=0.01,
        pitch=0.01,
        height=0.5,
        position_north=1.0,
        position_east=1.0,
        position_noise_m=0.1,
        position_bias_time_s=wander_s,
    )
    flat = np.array([1.0, 1.0, 0.0 if level else 0.3])
    times = np.cumsum(rng.uniform(0.01, 0.3, 60))
    belief = plain = None
    for t in times:
        spread = rng.normal(0.0, 0.3, (3, 3)) * flat[:, None]
        jacobian = rng.normal(0.0, 8.0, (3, BIAS_COUNT)) * flat[:, None]
        jacobian[:, Bias.POSITION_NORTH : Bias.TERRAIN] = np.eye(3)[:, :2]
        place = np.array([4.0, 3.0, 0.0]) + rng.normal(0.0, 0.5, 3) * flat
        fix = a_fix(t, place, spread @ spread.T + np.diag([0.01, 0.01, 0.0]), jacobian, p.bias_sigmas)
        arrays = FixArrays(fix, p)
        if belief is None:
            belief, plain = StaticKalman(p).initiate(fix), PlainFilter(arrays, p)
            continue
        belief = belief.predict(host_ns(t)).update(fix)
        plain.step(arrays)
        assert belief.position_ned == pytest.approx(plain.kalman.x, abs=1e-9)
        assert np.array(belief.cov) == pytest.approx(plain.cov, abs=1e-9)
