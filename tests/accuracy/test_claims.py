"""Claims over random flights, one instant drawn from each: by hand, ``pytest -m nightly -s tests/accuracy``."""

import os
import sys
from random import Random
from statistics import mean, stdev

import pytest

from fwav_companion.recording.error_statistics import CHI2_95, CHI2_999, wilson
from sitl_mock import Simulation
from tests.accuracy.flights import fly, plan_of, replayed
from tests.accuracy.kinds import RANDOM
from tests.accuracy.scores import Tracks

ESTIMATOR = os.environ.get("ACCURACY_ESTIMATOR", "second")
FLIGHTS = int(os.environ.get("ACCURACY_FLIGHTS", "300"))
PLAN_SEED = 2026
MINUTES = 120


def drawn_instant(index):
    """A sample at an instant drawn from all answers of a random flight; None where it had none."""
    plan = plan_of(RANDOM, index, PLAN_SEED)
    tracks = Tracks(Simulation(plan.options))
    for line in replayed(plan, fly(plan), ESTIMATOR):
        tracks.add(line)
    samples = [sample for each in tracks.matched()[0].values() for sample in tracks.answers(each, 0.0)]
    return Random(f"instant/{index}").choice(samples) if samples else None


@pytest.fixture(scope="module")
def instants():
    """By index of the flight."""
    return {index: sample for index in range(FLIGHTS) if (sample := drawn_instant(index)) is not None}


@pytest.mark.nightly
@pytest.mark.timeout(MINUTES * 60)
@pytest.mark.parametrize("frame", ["relative", "absolute"])
def test_claims_hold_at_an_instant_drawn_from_each_of_many_random_flights(instants, frame, capsys):
    by_flight = {index: getattr(sample, frame).normalised2 for index, sample in instants.items()}
    squares, wrong = list(by_flight.values()), [k for k, square in by_flight.items() if square > CHI2_999]
    inside, surely = (mean(square <= limit for square in squares) for limit in (CHI2_95, CHI2_999))
    with capsys.disabled():
        half = 1.96 * stdev(squares) / len(squares) ** 0.5
        low, high = wilson(inside, len(squares))
        sys.stdout.write(
            f"\n{ESTIMATOR}, {frame}: {len(squares)} of {FLIGHTS} flights; mean square {mean(squares):.2f}"
            f" +- {half:.2f}; inside 95 %: {inside:.1%} ({low:.1%} to {high:.1%}); inside 99.9 %: {surely:.2%}"
            f"; not in it: {wrong}\n"
        )
    assert len(squares) > 0.8 * FLIGHTS
    assert 0.92 <= inside <= 0.98
    assert surely >= 0.993
