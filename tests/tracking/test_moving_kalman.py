"""The moving filter against numpy: one plain state of position, velocity and biases, its gain that of the noise."""

import numpy as np
import pytest
from handmade import a_fix, host_ns
from scipy.spatial.transform import Rotation
from simulated_flight import priors

from fwav_companion.tracking.filters import moving
from fwav_companion.tracking.filters.consider_biases import DOWN_FLOOR_M2
from fwav_companion.tracking.filters.maneuver import LAGS
from fwav_companion.tracking.filters.moving import (
    ACCELERATION_DENSITY,
    CLIMB_DENSITY,
    START_CLIMB_M_S,
    START_SPEED_M_S,
    UNSEEN_DENSITY,
    UNSEEN_S,
    MovingKalman,
)
from fwav_companion.types import BIAS_COUNT, Bias

PRIORS = priors(
    roll=0.02,
    pitch=0.02,
    time_offset=0.0,
    position_north=1.0,
    position_east=1.0,
    height_noise_m=0.0,
    attitude_noise=0.0,
)
USED = [Bias.ROLL, Bias.PITCH, Bias.HEADING, Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z]
WANDERING = [Bias.POSITION_NORTH, Bias.POSITION_EAST]
SIGMAS = np.array(PRIORS.bias_sigmas)
ALONG = np.hstack([np.eye(3), np.zeros((3, 3))])


class Plain:
    """Position and velocity; covariance of their noise; covariance with the biases, one sigma each."""

    def __init__(self, fix, jacobian):
        self.x = np.array([*fix.position_ned, 0.0, 0.0, 0.0])
        self.noise = np.diag([0.0, 0.0, 0.0, START_SPEED_M_S**2, START_SPEED_M_S**2, START_CLIMB_M_S**2])
        self.noise[:3, :3] = self.of(fix)
        self.shared = np.vstack([jacobian, np.zeros_like(jacobian)])

    def of(self, fix):
        return np.array(fix.noise_cov) + np.diag([0.0, 0.0, DOWN_FLOOR_M2])

    def predict(self, dt, density):
        move, axes = np.eye(6) + dt * np.eye(6, k=3), np.diag([density, density, CLIMB_DENSITY])
        more = np.block([[axes * dt**3 / 3, axes * dt**2 / 2], [axes * dt**2 / 2, axes * dt]])
        self.x, self.noise, self.shared = move @ self.x, move @ self.noise @ move.T + more, move @ self.shared

    def update(self, fix, jacobian, scatter):
        """Turn the noise of the fix about the camera, above the origin, from its azimuth to the state's."""
        turn = np.arctan2(self.x[1], self.x[0]) - np.arctan2(fix.position_ned[1], fix.position_ned[0])
        axes = Rotation.from_euler("z", turn).as_matrix()
        noise = axes @ self.of(fix) @ axes.T
        expected = self.noise[:3, :3] + noise + np.diag([scatter, scatter, 0.0])
        gain = self.noise @ ALONG.T @ np.linalg.inv(expected)
        rest = np.eye(6) - gain @ ALONG
        self.x = self.x + gain @ (fix.position_ned - self.x[:3])
        self.noise = rest @ self.noise @ rest.T + gain @ noise @ gain.T
        self.shared = self.shared + gain @ (jacobian - self.shared[:3])


def drawn(rng, t, truth):
    root = rng.normal(0.0, 0.1, (3, 3))
    noise = root @ root.T + 0.01 * np.eye(3)
    jacobian = np.zeros((3, BIAS_COUNT))
    jacobian[:, USED] = rng.normal(0.0, 3.0, (3, len(USED)))
    jacobian[0, Bias.POSITION_NORTH] = jacobian[1, Bias.POSITION_EAST] = 1.0
    fix = a_fix(t, rng.multivariate_normal(truth, noise), noise, jacobian, SIGMAS)
    columns = [*USED, *WANDERING]
    return fix, jacobian[:, columns] * SIGMAS[columns]


def assert_same(state, plain):
    assert state.position_ned == pytest.approx(plain.x[:3], abs=1e-9)
    assert state.velocity_ned == pytest.approx(plain.x[3:], abs=1e-9)
    shared, velocity = plain.shared[:3], plain.shared[3:]
    lagging = plain.noise[:3, :3] + LAGS * np.outer(*[[state.lag.north_m, state.lag.east_m, 0.0]] * 2)
    assert np.array(state.cov) == pytest.approx(lagging + shared @ shared.T, abs=1e-9)
    assert np.array(state.velocity_cov) == pytest.approx(plain.noise[3:, 3:] + velocity @ velocity.T, abs=1e-9)
    relative = shared[:, : len(USED)]
    assert np.array(state.relative_cov) == pytest.approx(lagging + relative @ relative.T, abs=1e-9)
    assert np.array(state.cross) == pytest.approx(plain.noise[:3, 3:], abs=1e-9)


def test_prediction_and_update_are_those_of_the_plain_state(monkeypatch):
    """Over prediction through gaps too, where the target may turn; fixes come far apart, so none repeats telemetry.

    Turns that the innovations show are not in the plain state.
    """
    monkeypatch.setattr(moving, "TURNED", np.inf)
    rng, t = np.random.default_rng(4), 0.0
    fix, jacobian = drawn(rng, t, (4.0, 3.0, 0.0))
    state, plain = MovingKalman(PRIORS).initiate(fix), Plain(fix, jacobian)
    assert_same(state, plain)
    for k in range(40):
        gap_s = 0.003 * rng.integers(50, 270) if k % 5 else 3.0  # whole milliseconds, three times
        for at_s in np.cumsum([gap_s / 3] * 3):
            density = ACCELERATION_DENSITY if at_s < UNSEEN_S else UNSEEN_DENSITY
            plain.predict(gap_s / 3, density)
            state = state.predict(host_ns(t + at_s))
        t += gap_s
        assert_same(state, plain)
        fix, jacobian = drawn(rng, t, (4.0 + 0.8 * t, 3.0 - 0.5 * t, 0.0))
        scatter = state.scatter.variance
        state = state.update(fix)
        plain.update(fix, jacobian, scatter)
        assert_same(state, plain)


def test_an_instant_that_is_past_changes_nothing():
    state = MovingKalman(PRIORS).initiate(drawn(np.random.default_rng(5), 1.0, (4.0, 3.0, 0.0))[0])
    assert state.predict(host_ns(1.0)) is state
    assert state.predict(host_ns(0.5)) is state
