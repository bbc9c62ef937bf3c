"""A receiver whose accuracy changes in flight: its solutions as pieces of the error's prior."""

import numpy as np
import pytest
from estimated_flights import Planted, flown
from simulated_flight import Flight

from fwav_companion.estimation.errors import SampleNoise, priors
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.path_samples import PathNoise, PathSamples
from fwav_companion.estimation.sample_buffer import SampleBuffer
from fwav_companion.estimation.wander import QUICK, Pieces, Wander


def samples():
    return PathSamples(SampleBuffer(9), [], PathNoise((0.02, 0.1), (0.02, 0.1)))


def test_another_solution_begins_a_piece_and_a_small_change_widens_the_present_one():
    path = samples()
    for t, sigma_m in ((0.0, 1.0), (1.0, 2.0), (2.0, 1.0), (10.0, 0.02), (20.0, 0.3), (21.0, 0.3)):
        path.add_accuracy(t, sigma_m)
    assert [tuple(each) for each in path.accuracies] == [(0.0, 2.0), (10.0, 0.02), (20.0, 0.3)]
    piece, sigma = path.accuracy_at(np.array([-1.0, 9.0, 10.0, 25.0]))
    assert (piece.tolist(), sigma.tolist()) == ([0, 0, 1, 2], [2.0, 2.0, 0.02, 0.3])


def test_report_of_an_earlier_instant_begins_no_piece():
    path = samples()
    path.add_accuracy(5.0, 1.0)
    path.add_accuracy(4.0, 0.02)
    assert len(path.accuracies) == 1


def test_many_changes_keep_the_worse_of_the_oldest_two():
    path = samples()
    for k in range(12):
        path.add_accuracy(float(k), (1.0, 0.02)[k % 2])
    assert len(path.accuracies) == 8
    assert path.accuracies[0].sigma_m == 1.0
    assert path.accuracies[-1] == (11.0, 0.02)


def test_prior_of_pieces_is_the_best_wander_and_an_independent_one_in_each_worse_piece():
    knots, piece = np.array([0.0, 4.0, 8.0, 12.0]), np.array([0, 0, 1, 2])
    wander = Wander(0.1, (30.0,), QUICK, (0.01, 0.1))
    extra2 = np.array([1.0, 1.0, 0.0, 4.0])
    precision, log_det = wander.precision(knots, [], Pieces(piece, extra2))
    covariance = np.linalg.inv(precision)
    base = wander.covariance(np.abs(knots[:, None] - knots))
    assert covariance.diagonal() == pytest.approx(base.diagonal() + extra2, rel=1e-3)
    assert covariance[0, 1] - base[0, 1] == pytest.approx(wander.correlation(np.array([4.0]))[0], rel=1e-3)
    assert covariance[1, 3] == pytest.approx(base[1, 3], rel=1e-3)
    assert log_det == pytest.approx(np.linalg.slogdet(covariance)[1], abs=1e-6)


def solved(sigmas):
    """A flight whose receiver claims each of (t, sigma): the estimator after its last frame."""
    flight = Flight(seconds=16.0, fps=8.0, shape="turns", height_m=10.0, pitch_deg=0.0, targets=((1.0, 2.0),),
                    velocities=((0.0, 0.0),), labels=("",))  # fmt: skip

    def observe(estimator, stamp):
        due = [sigma_m for t, sigma_m in sigmas if t <= stamp]
        estimator.carrier.path.add_accuracy(stamp, due[-1])

    noise = SampleNoise(position_wander_m=1.0)
    return flown(Planted(flight, np.zeros(13)), priors(), noise=noise, observe=observe)


@pytest.mark.parametrize(
    ("sigmas", "least_m", "most_m"),
    [(((0.0, 1.0), (8.0, 0.02)), 0.0, 0.25), (((0.0, 0.02), (8.0, 1.0)), 0.0, 0.25), (((0.0, 1.0),), 0.4, 1.1)],
    ids=["gained", "lost", "never"],
)
def test_claim_of_the_place_is_that_of_the_best_solution(sigmas, least_m, most_m):
    estimator = solved(sigmas)
    assert isinstance(estimator, Estimator)
    answer = estimator.answer(0, 15.9)
    sigma_m = float(np.sqrt(np.linalg.eigvalsh(answer.covariance[:2, :2])[-1]))
    assert least_m < sigma_m < most_m


def test_live_error_goes_over_to_the_new_solution():
    estimator = solved(((0.0, 1.0),))
    live, e = estimator.live, estimator.live.error
    for t, sigma_m in ((18.0, 0.02), (20.0, 5.0)):
        estimator.carrier.path.add_accuracy(t, sigma_m)
        live.predict(t + 0.1)
        found = float(np.sqrt(live.covariance[e, e] + live.mean[e] ** 2))
        assert found == pytest.approx(sigma_m, rel=0.3, abs=0.05)
    assert np.linalg.eigvalsh(live.covariance)[0] > -1e-9
