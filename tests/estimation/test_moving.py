"""A moving target beside static ones that teach."""

import numpy as np
from estimated_flights import Planted, flown
from simulated_flight import Flight, path

from fwav_companion.estimation.errors import priors
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.initiation import begin_target

WALKER = 2


def walked(monkeypatch):
    """A turning flight over two static targets and a walker, and the estimator after it."""
    flight = Flight(seconds=12.0, fps=10.3, shape="turns", height_m=10.0, pitch_deg=0.0,
                    targets=((1.0, 2.0), (-1.5, 1.0), (-3.0, 0.0)),
                    velocities=((0.0, 0.0), (0.0, 0.0), (0.5, 0.1)), labels=("",) * 3)  # fmt: skip
    planted = Planted(flight, np.array([0.03, 0.01, -0.01, *[0.0] * 9]))

    def apart(self, s):
        if self.begin(float(s.t[0])) and WALKER in s.target and WALKER not in self.live:
            self.live.predict(float(s.t[0]))
            begin_target(self.live, WALKER, s.select(s.target == WALKER), moving=True)
        else:
            self.update_pairs(s, np.arange(len(s)), s.target, s.target != WALKER)

    monkeypatch.setattr(Estimator, "update", apart)
    return planted, flown(planted, priors())


def test_walker_is_within_its_claim_and_does_not_teach(monkeypatch):
    planted, estimator = walked(monkeypatch)
    t = estimator.live.t
    capture = t - 0.03
    answer = estimator.answer(WALKER, t)
    camera = path(planted.flight, np.array([t]))[0][0]
    true = np.array([-3.0 + 0.5 * capture, 0.1 * capture])
    error = true - camera[:2] - answer.relative[:2]
    assert np.hypot(*error) < 0.3
    assert error @ np.linalg.solve(answer.relative_covariance[:2, :2], error) < 18.0
    assert WALKER not in estimator.live.at
    assert WALKER not in estimator.kept.target
    velocity_error = answer.velocity - [0.5, 0.1]
    assert velocity_error @ np.linalg.solve(answer.velocity_covariance, velocity_error) < 18.0
