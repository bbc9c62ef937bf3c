"""The target relative to the vehicle near the ground: as right as the ray, whatever one reported position errs by."""

import numpy as np
from handmade import a_fix, host_ns
from msgspec.structs import replace
from simulated_flight import priors

from fwav_companion.tracking.filters import kalman
from fwav_companion.tracking.filters.kalman import StaticKalman
from fwav_companion.tracking.filters.linearization import SENSITIVE, level_columns
from fwav_companion.types import BIAS_COUNT, Bias

TARGET = np.array((0.08, -0.05))
"""From the camera, metres."""
PRIORS = priors(height=0.5, mount_x=0.02, mount_y=0.02, roll=0.009, pitch=0.009, position_north=1.0, position_east=1.0,
                position_noise_m=0.1)  # fmt: skip


def seen_from(t, reported):
    """A sight of the target from 1 m, by a camera at the origin that is reported elsewhere."""
    noise = np.diag([0.1**2 + 0.005**2, 0.1**2 + 0.005**2, 0.0])
    fix = a_fix(t, (*(TARGET + reported), 0.0), noise, None, PRIORS.bias_sigmas)
    camera = (float(reported[0]), float(reported[1]), -1.0)
    fix = replace(fix, ground="home", sighting=replace(fix.sighting, camera_ned=camera, camera_height_above_home_m=1.0))
    jacobian = np.zeros((3, BIAS_COUNT))
    jacobian[[0, 1], [Bias.POSITION_NORTH, Bias.POSITION_EAST]] = 1.0
    for bias, column in zip(SENSITIVE, level_columns(fix, float(TARGET[0]), float(TARGET[1]), 1.0), strict=True):
        jacobian[:2, bias] = column
    return replace(fix, bias_jacobian=tuple(tuple(map(float, column)) for column in jacobian.T))


def errors_of(noise_m):
    """Errors relative to the vehicle, and one sigma claimed, after each of these errors of one position."""
    rng, state = np.random.default_rng(4), None
    for k in range(100):
        fix = seen_from(0.1 * k, rng.normal(0.0, 0.1, 2))
        state = StaticKalman(PRIORS).initiate(fix) if state is None else state.predict(host_ns(0.1 * k)).update(fix)
    found = []
    for off_m in noise_m:
        reported = np.array((off_m, 0.0))
        after = state.predict(host_ns(10.0)).update(seen_from(10.0, reported))
        error = np.array(after.apparent_ned[:2]) - reported - TARGET
        found.append((float(np.hypot(*error)), float(np.sqrt(after.relative_cov[0][0]))))
    return found


def test_the_noise_of_one_position_moves_it_by_less_than_its_claim():
    for error_m, sigma_m in errors_of((-0.35, -0.2, 0.2, 0.35)):
        assert error_m < 1.5 * sigma_m < 0.1


def test_sensitivities_at_the_predicted_target_would_take_the_noise_for_a_bias(monkeypatch):
    monkeypatch.setattr(kalman, "OWN_RAY", 1e9)
    assert max(error_m / sigma_m for error_m, sigma_m in errors_of((-0.35, 0.35))) > 2.0
