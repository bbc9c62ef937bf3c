"""The delay's bank of starts: its pieces, between which a thread may be ended."""

from collections import Counter

import numpy as np
from estimated_flights import Planted, problem_of
from simulated_flight import Flight

from fwav_companion.estimation.delay_search import search_delay
from fwav_companion.estimation.errors import CAMERA_DELAY, SampleNoise
from fwav_companion.estimation.problem import Problem


def test_pieces_of_a_search_linearise_once_and_place_the_targets_of_one_start(monkeypatch):
    flight = Flight(seconds=8.0, fps=4.0, shape="turns", height_m=8.0, pitch_deg=0.0, targets=((1.0, 2.0),),
                    velocities=((0.0, 0.0),))  # fmt: skip
    errors = np.zeros(13)
    errors[0] = 0.02
    problem = problem_of(Planted(flight, errors), SampleNoise())
    counts, pieces = Counter(), []

    def count(name):
        method = getattr(Problem, name)

        def counted(self, *args):
            counts[name] += 1
            return method(self, *args)

        monkeypatch.setattr(Problem, name, counted)

    count("linearise")
    count("first_targets")
    search = search_delay(problem.s, problem.carrier, problem.model, float(problem.s.t[-1]), {})
    while True:
        counts.clear()
        try:
            next(search)
        except StopIteration as done:
            modes = done.value
            break
        pieces.append(dict(counts))
    assert len(pieces) > 20
    assert all(count == 1 for piece in pieces for count in piece.values())
    assert abs(modes[0].shared[CAMERA_DELAY] - 0.02) < 0.002
