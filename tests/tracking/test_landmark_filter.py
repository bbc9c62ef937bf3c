"""The filter of landmarks against one batch of linear algebra over all errors and places together."""

import msgspec
import numpy as np
import pytest

from fwav_companion.config.estimation import UncertaintyConfig
from fwav_companion.geometry.earth import Geodetic
from fwav_companion.tracking.landmarks.joint_place import UNKNOWN_M, Correction, Transition, unknown_place
from fwav_companion.tracking.landmarks.landmark_filter import LandmarkFilter
from fwav_companion.tracking.landmarks.state_vector import SharedErrors
from fwav_companion.types import Landmark, LandmarkRecord, LandmarkState

RNG = np.random.default_rng(5)
SHARED = 4


def by_least_squares(prior, events) -> tuple[np.ndarray, np.ndarray]:
    """Place and the newest shared errors, and their covariance: one batch over the whole history.

    ``prior``: mean and covariance of the shared errors; ``events``: corrections of (place, shared errors), transitions.
    """
    mean, cov = prior
    count = 2 + SHARED * (1 + sum(isinstance(event, Transition) for event in events))
    rows, values, now = [], [], slice(2, 2 + SHARED)

    def whitened(blocks, value, noise):
        root = np.linalg.inv(np.linalg.cholesky(noise))
        row = np.zeros((len(value), count))
        for where, block in blocks:
            row[:, where] = block
        rows.append(root @ row)
        values.append(root @ value)

    whitened([(slice(0, 2), np.eye(2))], np.zeros(2), UNKNOWN_M**2 * np.eye(2))
    whitened([(now, np.eye(SHARED))], mean, cov)
    for event in events:
        if isinstance(event, Transition):
            later = slice(now.stop, now.stop + SHARED)
            whitened([(later, np.eye(SHARED)), (now, -event.matrix)], np.zeros(SHARED), event.noise)
            now = later
        else:
            whitened([(slice(0, 2), event.rows[:, :2]), (now, event.rows[:, 2:])], event.measured, event.noise)
    matrix = np.vstack(rows)
    information = matrix.T @ matrix
    kept = [0, 1, *range(now.start, now.stop)]
    best = np.linalg.solve(information, matrix.T @ np.concatenate(values))
    return best[kept], np.linalg.inv(information)[np.ix_(kept, kept)]


def drawn_prior() -> tuple[np.ndarray, np.ndarray]:
    root = RNG.normal(size=(SHARED, SHARED))
    return RNG.normal(size=SHARED), root @ root.T


def drawn_fix() -> Correction:
    rows = np.hstack((np.eye(2), RNG.normal(size=(2, SHARED))))
    return Correction(RNG.normal(size=2), rows, np.diag(RNG.uniform(0.1, 1.0, 2)))


def drawn_sight() -> Correction:
    return Correction(RNG.normal(size=2), RNG.normal(size=(2, SHARED)), np.diag(RNG.uniform(0.1, 1.0, 2)))


def test_a_place_and_its_claim_are_those_of_all_fixes_and_sights_together():
    prior, first = drawn_prior(), drawn_fix()
    place, events = unknown_place((0.0, 0.0, 0.0), prior, np.ones(SHARED)).update(first), [first]
    for turn in range(12):
        if turn % 3 == 0:
            sight = drawn_sight()
            place = place.after(sight)
            events.append(Correction(sight.measured, np.hstack((np.zeros((2, 2)), sight.rows)), sight.noise))
        elif turn % 3 == 1:
            events.append(drawn_fix())
            place = place.update(events[-1])
        else:
            noise = np.diag(RNG.uniform(0.1, 0.3, SHARED))
            events.append(Transition(np.diag(RNG.uniform(0.5, 1.0, SHARED)), noise))
            place = place.after(events[-1])
        best, cov = by_least_squares(prior, events)
        assert place.mean == pytest.approx(best, abs=1e-8)
        assert place.cov == pytest.approx(cov, abs=1e-8)


def test_what_is_considered_stays_and_its_share_stays_in_the_claim():
    """The third error is considered: neither its mean nor its variance moves, and no claim is less than the best."""
    prior, first, estimated = drawn_prior(), drawn_fix(), np.array((1.0, 1.0, 0.0, 1.0))
    place, events = unknown_place((0.0, 0.0, 0.0), prior, estimated).update(first), [first]
    for _ in range(20):
        events.append(drawn_fix())
        place = place.update(events[-1])
    assert place.mean[4] == pytest.approx(prior[0][2])
    assert place.cov[4, 4] == pytest.approx(prior[1][2, 2])
    _, best = by_least_squares(prior, events)
    assert np.linalg.eigvalsh(place.cov - best)[0] > -1e-9


@pytest.mark.parametrize(("used", "known"), [(9, True), (2, False)])
def test_the_altitude_is_what_sights_show_without_its_prior(used, known):
    """Sights that show 4 m with 3 m of sigma, on a receiver of 1 m, whose altitude has a prior of 2 m."""
    landmark = Landmark("mark", Geodetic.from_degrees(48.0, 11.0, 500.0), 0.4)
    state = LandmarkFilter.start(
        SharedErrors(UncertaintyConfig().priors(readout_known=True, surveyed=False), [landmark])
    )
    index, prior = state.model.altitude, (2.0 * state.sigma_m) ** 2
    cov, mean = state.cov.copy(), state.mean.copy()
    cov[index, index] = 1.0 / (1.0 / prior + 1.0 / 9.0)
    mean[index] = cov[index, index] * 4.0 / 9.0
    record = LandmarkRecord("mark", LandmarkState.USED, used=used)
    seen = msgspec.structs.replace(state, cov=cov, mean=mean, records=(record,))
    assert state.altitude is None, "not seen"
    if not known:
        assert seen.altitude is None, "hardly seen"
        return
    assert seen.altitude.too_high_m == pytest.approx(4.0)
    assert seen.altitude.sigma_m == pytest.approx(np.hypot(3.0, 0.4))
