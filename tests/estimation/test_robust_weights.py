"""Robust weights by what all others predict, against fits that leave each measurement out."""

import numpy as np
import pytest
from estimated_flights import Planted, problem_of
from simulated_flight import Flight

from fwav_companion.estimation.errors import SampleNoise
from fwav_companion.estimation.information import sighting_rows
from fwav_companion.estimation.post_fit import judge_sightings, post_fit
from fwav_companion.estimation.problem import State
from fwav_companion.estimation.robust_weights import leave_one_out_distance2, survey_weights
from fwav_companion.estimation.smoother import gauss_newton_step, iterate, sighting_noise
from fwav_companion.estimation.wander import SMOOTH


@pytest.fixture(scope="module")
def problem():
    """A turning flight of twelve seconds over one target, on a receiver that wanders by a metre."""
    flight = Flight(seconds=12.0, fps=4.7, shape="turns", height_m=8.0, pitch_deg=0.0, targets=((1.0, 2.0),))
    planted = Planted(flight, np.zeros(13), wander_m=1.0)
    return problem_of(planted, SampleNoise(position_wander_m=1.0, height_wander_m=0.1))


def fitted(problem, displaced_sigmas):
    """The weights after a solve whose sighting 30 is displaced by so many sigmas of its noise."""
    residual = problem.linearise

    def linearise(state, kernel):
        found = residual(state, kernel)
        found.residual[0, 30] += displaced_sigmas
        return found

    problem.linearise = linearise
    try:
        errors = np.zeros((len(problem.knots), 3))
        state = State(problem.model.priors.mean, problem.first_targets(np.zeros(13), errors, {}), errors)
        pieces = iterate(problem, state, SMOOTH, None, most=4, enough=0.5)
        while True:
            next(pieces)
    except StopIteration as done:
        return done.value[2].weight
    finally:
        problem.linearise = residual
        problem.bridge = np.zeros_like(problem.bridge)


def test_false_detection_is_left_out_where_the_wander_would_explain_it(problem):
    """37 sigmas; weighed by residuals that its own error has bent, it counted as 0.98."""
    weight = fitted(problem, 37.0)
    assert weight[30] < 0.01
    assert np.delete(weight, 30).min() > 0.5
    assert fitted(problem, 0.0)[30] > 0.9


def test_distances_are_those_of_fits_that_leave_each_measurement_out():
    rng = np.random.default_rng(4)
    count, unknowns = 9, 4
    h, r = rng.normal(size=(2, count, unknowns)), rng.normal(size=(2, count))
    root = rng.normal(size=(count, 2, 2))
    noise = root @ root.transpose(0, 2, 1) + np.eye(2)
    weight = rng.uniform(0.3, 1.0, count)
    used = noise + (1.0 / weight - 1.0)[:, None, None] * np.eye(2)

    def fit(which):
        information = np.eye(unknowns) + sum(h[:, i].T @ np.linalg.solve(used[i], h[:, i]) for i in which)
        covariance = np.linalg.inv(information)
        return covariance @ sum(h[:, i].T @ np.linalg.solve(used[i], r[:, i]) for i in which), covariance

    mean, covariance = fit(range(count))
    known = np.einsum("aiu,uv,biv->abi", h, covariance, h)
    found = leave_one_out_distance2(r - h @ mean, known, noise.transpose(1, 2, 0), weight)
    for i in range(count):
        other, spread = fit([j for j in range(count) if j != i])
        innovation, expected = r[:, i] - h[:, i] @ other, noise[i] + h[:, i] @ spread @ h[:, i].T
        assert found[i] == pytest.approx(innovation @ np.linalg.solve(expected, innovation), rel=0.03)


def test_prediction_by_all_sightings_is_that_of_the_dense_fit(problem):
    errors = np.zeros((len(problem.knots), 3))
    state = State(np.zeros(13), problem.first_targets(np.zeros(13), errors, {}), errors)
    projection = problem.linearise(state, SMOOTH)
    rows, noise = sighting_rows(problem, projection), sighting_noise(problem, projection, SMOOTH)
    step = gauss_newton_step(problem, state, projection, noise, SMOOTH, rows)
    after = post_fit(problem, rows, projection.residual, step.step, step.covariance)
    n, o, size = len(problem.s), problem.errors_at, problem.size
    j, inverse = np.zeros((2, n, size)), np.zeros((n, 2, 2))
    for i in range(n):
        left = problem.left[i]
        j[:, i, :o], j[:, i, o + 3 * left : o + 3 * left + 6] = rows[:, :o, i], rows[:, o:, i]
        inverse[i] = np.linalg.inv(np.eye(2) + noise.common[..., i] @ noise.common[..., i].T)
    prior = problem.prior(SMOOTH)[0]
    covariance = np.linalg.inv(prior + np.einsum("aiu,iab,biv->uv", j, inverse, j))
    right = np.einsum("aiu,iab,bi->u", j, inverse, projection.residual)
    right -= prior @ problem.deviation(state)
    mean = covariance @ right
    assert after.residual == pytest.approx(projection.residual - j @ mean, abs=1e-4)
    assert after.known == pytest.approx(np.einsum("aiu,uv,biv->abi", j, covariance, j), rel=1e-3, abs=1e-6)
    assert judge_sightings(problem, noise, after).mean() == pytest.approx(2.0, abs=1.0)


def test_of_surveys_that_count_the_farthest_is_left_out_first():
    ones = np.ones(3)
    assert survey_weights(np.array([10.0, 43.0, 11.0]), ones) == pytest.approx([1.0, 0.0, 1.0], abs=1e-5)
    assert survey_weights(np.array([1.0, 2.0, 0.5]), ones).min() > 0.95
    left_out = np.array([1.0, 1e-7, 1.0])
    assert survey_weights(np.array([1.0, 60.0, 40.0]), left_out)[2] < 1e-3  # a second one
    assert survey_weights(np.array([1.0, 2.0, 1.0]), left_out)[1] > 0.9  # it returns


def test_two_surveys_that_contradict_each_other_count_by_half():
    assert survey_weights(np.array([40.0, 40.0]), np.ones(2)) == pytest.approx([0.5, 0.5], abs=1e-3)
