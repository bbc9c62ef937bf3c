"""The static filter against plain numpy, over fixes that are all different."""

import numpy as np
import pytest
from handmade import a_fix, host_ns
from msgspec.structs import replace
from simulated_flight import priors

from fwav_companion.tracking.filters.kalman import StaticKalman
from fwav_companion.types import BIAS_COUNT, Bias
from tests.benchmarks.plain_filter import FixArrays, PlainFilter


@pytest.mark.parametrize(("wander_m", "wander_s"), [(1.0, 60.0), (0.0, 60.0), (1.0, 20.0), (1.0, (60.0, 1800.0))])
def test_the_state_is_what_numpy_makes_of_the_same_fixes(wander_m, wander_s):
    rng = np.random.default_rng(12)
    p = priors(
        roll=0.01,
        pitch=0.01,
        height=0.5,
        position_north=wander_m,
        position_east=wander_m,
        position_noise_m=0.1,
        position_bias_time_s=wander_s,
        position_delay=0.05,
        lever_x=0.03,
    )
    if isinstance(wander_s, tuple):
        p = replace(p, position_bias_time_s=wander_s[0], position_wander_times_s=wander_s)
    state = plain = None
    for t in np.cumsum(rng.uniform(0.1, 0.5, 60)):
        spread = rng.normal(0.0, 0.3, (3, 3)) * [[1.0], [1.0], [0.0]]
        jacobian = rng.normal(0.0, 8.0, (3, BIAS_COUNT)) * [[1.0], [1.0], [0.0]]
        jacobian[:, [Bias.POSITION_NORTH, Bias.POSITION_EAST]] = np.eye(3)[:, :2]
        place = np.array([4.0, 3.0, 0.0]) + rng.normal(0.0, 0.5, 3) * [1.0, 1.0, 0.0]
        fix = a_fix(t, place, spread @ spread.T + np.diag([0.03, 0.03, 0.0]), jacobian, p.bias_sigmas)
        arrays = FixArrays(fix, p)
        if state is None:
            state, plain = StaticKalman(p).initiate(fix), PlainFilter(arrays, p)
            continue
        state = state.predict(host_ns(t)).update(fix)
        plain.step(arrays)
        assert state.position_ned[:2] == pytest.approx(plain.mean_all[0] if wander_m else plain.apparent, abs=1e-9)
        assert (state.apparent.north_m, state.apparent.east_m) == pytest.approx(tuple(plain.apparent), abs=1e-9)
        if wander_m:
            assert np.array(state.cov)[:2, :2] == pytest.approx(plain.cov, abs=1e-9)
        else:
            shared = plain.shared @ plain.shared.T
            assert np.array(state.cov)[:2, :2] == pytest.approx(plain.noise + shared, abs=1e-9)
