"""The coarse gate: the same tracks as with every pair of track and fix compared, from few of the pairs."""

import numpy as np
import pytest
from handmade import a_fix, a_view
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.tracking import TrackingOptions, coarse_gate, make_tracker
from fwav_companion.tracking.coarse_gate import possible_pairs
from fwav_companion.tracking.filters.gates import GATE
from fwav_companion.tracking.filters.kalman import StaticKalman
from fwav_companion.types import BIAS_COUNT, Bias

TARGETS = tuple((6.0 * (i - 3), 4.0 * (j - 3)) for i in range(7) for j in range(7))
MANY = {"targets": TARGETS, "velocities": ((0.0, 0.0),) * 49, "labels": ("a", "b", "a", "a", "a", "a", "a") * 7}


def tracks_of(monkeypatch, flight, few_pairs, **options):
    monkeypatch.setattr(coarse_gate, "FEW_PAIRS", few_pairs)
    tracker = make_tracker(TrackingOptions(**options), flight.priors)
    return [tracker.on_frame(view) for view in World(flight).frames()]


@pytest.mark.parametrize("options", [{}, {"filter": "lowpass"}, {"motion": "moving"}])
def test_a_flight_has_the_same_tracks_with_and_without_it(monkeypatch, options):
    p = priors(position_north=1.0, position_east=1.0, height=0.5)
    flight = Flight(height_m=25.0, fps=5.0, seconds=6.0, miss=0.2, clutter=1.0, priors=p, **MANY).drawn(3)
    every = tracks_of(monkeypatch, flight, 10**9, **options)
    assert tracks_of(monkeypatch, flight, 0, **options) == every
    assert max(map(len, every)) > 20


def random_fix(rng, t, place, sigmas, detector_id):
    root = rng.normal(size=(2, 2)) * rng.choice([0.03, 0.3])
    noise = np.zeros((3, 3))
    noise[:2, :2] = root @ root.T + 1e-3 * np.eye(2)
    jacobian = np.zeros((3, BIAS_COUNT))
    jacobian[:2, : Bias.POSITION_NORTH] = rng.normal(size=(2, Bias.POSITION_NORTH))
    slope = rng.normal(size=(2, 2)) * rng.choice([0.0, 0.3])
    jacobian[:2, [Bias.POSITION_NORTH, Bias.POSITION_EAST]] = np.eye(2) + slope
    return a_fix(t, (*place, 0.0), noise, jacobian, sigmas, detector_id=detector_id)


@settings(max_examples=40, derandomize=True, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.5, 20.0), st.booleans())
def test_it_leaves_out_no_pair_that_the_gate_accepts(seed, spread_m, with_ids):
    """Random noise, sensitivities, slopes of the ground, ages and places."""
    rng = np.random.default_rng(seed)
    sizes = {b.name.lower(): float(s) for b, s in zip(Bias, rng.choice([0.0, 0.1, 1.0], BIAS_COUNT), strict=True)}
    p = priors(**sizes)
    kalman = StaticKalman(p)

    def fix(t, place):
        return random_fix(rng, t, place, p.bias_sigmas, int(rng.integers(9)) if with_ids else None)

    targets = []
    for i, place in enumerate(rng.normal(size=(16, 2)) * spread_m):
        target = kalman.initiate(fix(0.0, place))
        for k in range(1, int(rng.integers(1, 6))):
            target = target.update(fix(0.1 * k, place + rng.normal(size=2)))
        targets.append((i, target.predict(a_view(float(rng.choice([1.0, 300.0]))).host_ns)))
    gates = np.full(16, GATE) if with_ids else rng.uniform(0.0, GATE, 16)
    places = enumerate(rng.normal(size=(16, 2)) * spread_m)
    fixes = [(j, fix(1.0, place), gate) for (j, place), gate in zip(places, gates.tolist(), strict=True)]
    accepted = {(i, j) for i, target in targets for j, each, gate in fixes if target.gate(each).nis < gate}
    assert accepted <= pairs(possible_pairs(targets, fixes))


def pairs(possible):
    return {(i, j) for i, near in possible.items() for j in near}


def test_of_far_targets_it_compares_few_pairs():
    p = priors(position_north=1.0, position_east=1.0, height=0.5)
    kalman, rng = StaticKalman(p), np.random.default_rng(0)
    columns = np.zeros((3, BIAS_COUNT))
    columns[0, Bias.POSITION_NORTH] = columns[1, Bias.POSITION_EAST] = 1.0
    places = [(8.0 * (i % 16), 8.0 * (i // 16), 0.0) for i in range(256)]
    fixes = [(j, a_fix(0.1, place, jacobian=columns, sigmas=p.bias_sigmas), GATE) for j, place in enumerate(places)]
    targets = [(i, kalman.initiate(fixes[i][1])) for i in rng.permutation(256)[:200].tolist()]
    assert possible_pairs(targets, fixes) == {i: [i] for i, _ in targets}
