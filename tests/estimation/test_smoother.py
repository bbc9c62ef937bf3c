"""The smoother against scipy's least squares, and the noise that a frame's sightings share against dense matrices."""

from dataclasses import replace

import numpy as np
import pytest
from estimated_flights import Planted, problem_of
from scipy.optimize import least_squares
from simulated_flight import Flight

from fwav_companion.estimation.errors import SampleNoise
from fwav_companion.estimation.information import _divide_by_noise, normal_equations
from fwav_companion.estimation.kept_sightings import Sightings, thinned
from fwav_companion.estimation.problem import Problem, State
from fwav_companion.estimation.smoother import COMMON, iterate, sighting_noise
from fwav_companion.estimation.wander import SMOOTH


def all_weights(distance2):
    """No sighting is doubted."""
    return np.ones(len(distance2))


@pytest.fixture(scope="module")
def problem():
    """Sixty sightings of two targets of a turning flight, wandering position."""
    flight = Flight(seconds=12.0, fps=2.5, shape="turns", height_m=8.0, pitch_deg=0.0,
                    targets=((1.0, 2.0), (-1.0, 1.0)), velocities=((0.0, 0.0),) * 2)  # fmt: skip
    planted = Planted(flight, np.array([0.02, 0.01, -0.01, 0.0, 0.02, 0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 0.0]))
    problem = problem_of(planted, SampleNoise(position_wander_m=0.3, height_wander_m=0.1), stretch=4.0)
    assert len(problem.s) > 40
    return problem


def result_of(pieces):
    """What a generator returns at its end."""
    while True:
        try:
            next(pieces)
        except StopIteration as done:
            return done.value


def start(problem):
    errors = np.zeros((len(problem.knots), 3))
    shared = problem.model.priors.mean
    return State(shared, problem.first_targets(shared, errors, {}), errors)


def dense_noise(weighted, problem):
    """(2 N, 2 N) covariance of all residuals, first components first: a frame's common noise, pixels."""
    n, frame = len(problem.s), np.tile(problem.s.frame, 2)
    g = weighted.common.transpose(0, 2, 1).reshape(2 * n, -1)
    by_frame = np.where(frame[:, None] == frame, g @ g.T, 0.0)
    return by_frame + np.diag(np.tile(1 / weighted.weight, 2))


def test_smoother_is_the_minimum_that_scipy_finds(problem, monkeypatch):
    # Derivatives without the removal of noise: Gauss-Newton then solves the very problem that scipy solves.
    monkeypatch.setattr(problem, "_path_noise", lambda shared, poses, kernel: np.zeros((2, len(problem.s))))
    monkeypatch.setattr(problem.carrier.attitudes, "motion_share", lambda t, fast, slow: np.ones((3, 1)))
    monkeypatch.setattr(problem, "_rates", None)
    samples = problem.carrier.path.buffer.values
    monkeypatch.setattr(problem.carrier.path, "buffer", problem.carrier.path.buffer.copy())
    problem.carrier.path.buffer.values[6:9] = samples[3:6]
    state, step, _ = result_of(iterate(problem, start(problem), SMOOTH, all_weights, most=20, enough=1e-8))
    projection = problem.linearise(state, SMOOTH)
    weighted = sighting_noise(problem, projection, SMOOTH)
    white = np.linalg.inv(np.linalg.cholesky(dense_noise(weighted, problem)))
    prior_root = np.linalg.cholesky(problem.prior(SMOOTH)[0]).T

    def residuals(x):
        at = state.plus(x)
        return np.concatenate(
            [white @ problem.linearise(at, SMOOTH).residual.ravel(), prior_root @ problem.deviation(at)]
        )

    found = least_squares(
        residuals, np.zeros(problem.size), x_scale=1 / np.sqrt(problem.prior(SMOOTH)[0].diagonal() + 1)
    )
    covariance = np.linalg.inv(found.jac.T @ found.jac)
    shared = problem.shared_size
    sigma = np.sqrt(np.diag(covariance))[: shared + 6]
    assert np.abs(found.x[: shared + 6] / sigma).max() < 0.15
    assert np.sqrt(np.diag(step.covariance))[: shared + 6] == pytest.approx(sigma, rel=0.1)


def test_normal_equations_are_those_of_the_dense_noise(problem):
    state = start(problem)
    projection = problem.linearise(state, SMOOTH)
    weighted = sighting_noise(problem, projection, SMOOTH)._replace(weight=np.linspace(0.3, 1.0, len(problem.s)))
    found = normal_equations(problem, projection, weighted)
    n, o = len(problem.s), problem.errors_at
    j = np.zeros((2, n, problem.size))
    for i in range(n):
        target, left, part = problem.of_target[i], problem.left[i], problem.part[i]
        j[:, i, : problem.shared_size] = projection.shared[..., i]
        a = problem.shared_size + 3 * target
        j[:, i, a : a + 3] = projection.point[..., i]
        for knot, share in ((left, 1 - part), (left + 1, part)):
            j[:, i, o + 3 * knot : o + 3 * knot + 3] += projection.point[..., i] * share
    j, r = j.reshape(2 * n, -1), projection.residual.ravel()
    noise = dense_noise(weighted, problem)
    inverse = np.linalg.inv(noise)
    scale = np.abs(j.T @ inverse @ j).max()
    assert found.information == pytest.approx(j.T @ inverse @ j, abs=1e-9 * scale)
    assert found.right == pytest.approx(j.T @ inverse @ r, abs=1e-9 * scale)
    assert found.squares == pytest.approx(r @ inverse @ r, rel=1e-9)
    assert found.log_determinant == pytest.approx(np.linalg.slogdet(noise)[1], rel=1e-9)


def test_noise_of_frames_of_one_and_of_several_sightings_is_divided_alike():
    rng = np.random.default_rng(3)
    frame = np.array([0, 1, 1, 1, 2, 3, 3])
    rows, common, weight = rng.normal(size=(2, 5, 7)), rng.normal(size=(2, COMMON, 7)), rng.uniform(0.2, 1.0, 7)
    divided, log_det = _divide_by_noise(rows, common, weight, frame)
    g = common.transpose(0, 2, 1).reshape(14, COMMON)
    same = np.tile(frame, 2)[:, None] == np.tile(frame, 2)
    noise = np.where(same, g @ g.T, 0.0) + np.diag(np.tile(1 / weight, 2))
    assert divided.transpose(0, 2, 1).reshape(14, 5) == pytest.approx(
        np.linalg.solve(noise, rows.transpose(0, 2, 1).reshape(14, 5))
    )
    assert log_det == pytest.approx(np.linalg.slogdet(noise)[1])


def test_thinning_keeps_a_few_of_thirty_targets_in_many_frames():
    frames, targets = 600, 30
    count = frames * targets
    frame, target = np.repeat(np.arange(frames), targets), np.tile(np.arange(targets), frames)
    rays, tangents = np.tile([[0.0], [0.0], [1.0]], (1, count)), np.zeros((2, 3, count))
    every = Sightings(frame * 0.1, rays, tangents, frame, target, np.zeros(count))
    kept = thinned(every.select((target < 5) | (frame % 2 == 0)), 60.0, 400)
    of_target = np.bincount(kept.target, minlength=targets)
    assert len(kept) <= 400
    assert of_target[:5].min() >= 45
    assert of_target[5:].min() >= 4
    assert (np.diff(kept.frame) >= 0).all()


def test_sightings_of_a_frame_keep_their_own_instants_whatever_their_order(problem):
    """A rolling shutter: detections of one frame come in the order of their tracks, not of their rows."""
    s, shared = problem.s, np.zeros(13)
    row = np.where(s.target == 0, 0.9, 0.1)
    rolling = replace(s, t=s.t + 0.03 * row, row=row)
    other = rolling.select(np.lexsort((-rolling.target, rolling.frame)))
    one, two = (Problem(problem.model, problem.carrier, each, problem.knots).poses(shared) for each in (rolling, other))
    first, second = np.lexsort((rolling.t, rolling.target)), np.lexsort((other.t, other.target))
    assert two.position[:, second] == pytest.approx(one.position[:, first], abs=1e-9)
    assert two.rotation[..., second] == pytest.approx(one.rotation[..., first], abs=1e-9)
