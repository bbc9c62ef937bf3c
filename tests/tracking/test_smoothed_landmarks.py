"""Landmarks as the smoother's targets: priors, one survey for all tracks of a landmark, records."""

from types import SimpleNamespace

import numpy as np
import pytest

from fwav_companion.geometry.earth import Geodetic
from fwav_companion.tracking.smoothed.smoothed_landmarks import SmoothedLandmarks
from fwav_companion.types import GroundReference, HeightReference, Landmark, LandmarkState

MARK = Landmark("mark", Geodetic(47.0, 8.0, 400.0), 0.05)


class FakeLive(dict):
    """Means (3,) and covariances (3, 3) of places by track."""

    def place(self, track):
        return self[track]


class FakeEstimator:
    def __init__(self, receiver_m=0.0):
        self.live, self.model = None, SimpleNamespace(noise=SimpleNamespace(position_wander_m=receiver_m))
        self.targets, self.renamed = {}, []
        self.estimate = SimpleNamespace(targets={}, surveys={})

    def rename(self, old, new):
        self.renamed.append((old, new))


HOME = GroundReference(HeightReference.ALTITUDE, level_m=0.2)


def sight(drop_m=11.5):
    """A sight from 12 m above the origin."""
    sighting = SimpleNamespace(camera_ned=(0.0, 0.0, -12.0), anchor_height_m=0.0, anchor_sigma_m=0.0)
    return SimpleNamespace(
        landmark=0, fix=SimpleNamespace(sighting=sighting, height_above_target_m=drop_m), north_m=3.0, east_m=-2.0
    )


@pytest.fixture
def estimator():
    return FakeEstimator()


def test_sight_gives_the_track_the_survey_with_its_height_above_the_ground(estimator):
    SmoothedLandmarks([MARK]).add(sight(), 4, estimator, HOME)
    prior = estimator.targets[4]
    assert prior.place == (3.0, -2.0)
    assert prior.height_m == pytest.approx(0.3)
    assert (prior.place_sigma_m, prior.height_sigma_m) == (0.05, 0.05)


def test_later_track_of_a_landmark_continues_the_earlier_one(estimator):
    landmarks = SmoothedLandmarks([MARK])
    for track in (4, 4, 7):
        landmarks.add(sight(), track, estimator, HOME)
    assert estimator.renamed == [(4, 7)]
    assert set(estimator.targets) == {4, 7}


def test_second_track_at_a_landmarks_label_waits_until_the_first_has_ended(estimator):
    landmarks = SmoothedLandmarks([MARK])
    landmarks.add(sight(), 4, estimator, HOME)
    landmarks.add(sight(), 7, estimator, HOME, {4, 7})
    assert (estimator.renamed, set(estimator.targets)) == ([], {4})
    landmarks.add(sight(), 7, estimator, HOME, {7})
    assert (estimator.renamed, set(estimator.targets)) == ([(4, 7)], {4, 7})


@pytest.mark.parametrize("height", [HeightReference.CONSTANT, HeightReference.RANGE, HeightReference.TERRAIN_REPORT])
def test_landmark_lies_on_ground_from_which_heights_count(estimator, height):
    SmoothedLandmarks([MARK]).add(sight(), 4, estimator, GroundReference(height, level_m=7.0))
    assert (estimator.targets[4].height_m, estimator.targets[4].height_sigma_m) == (0.0, 0.05)


def test_height_of_a_landmark_is_as_uncertain_as_the_receivers_altitude():
    estimator = FakeEstimator(receiver_m=1.5)
    SmoothedLandmarks([MARK]).add(sight(), 4, estimator, HOME)
    assert estimator.targets[4].height_sigma_m == pytest.approx(np.hypot(3.0, 0.05))
    assert estimator.targets[4].place_sigma_m == 0.05


def test_altitude_by_a_used_landmark_is_how_much_higher_it_appears_without_its_prior():
    """Measured 1.75 m too high with a sigma of 0.2 m: with a prior of 1 m, mean and variance are by the weights."""
    landmarks, estimator = SmoothedLandmarks([MARK]), FakeEstimator(receiver_m=0.5)
    landmarks.add(sight(), 4, estimator, HOME)
    prior = estimator.targets[4]
    weights = 0.2**-2, prior.height_sigma_m**-2
    mean = prior.height_m + 1.75 * weights[0] / sum(weights)
    estimator.live = FakeLive({4: (np.array([3.0, -2.0, mean]), np.diag([0.01, 0.01, 1.0 / sum(weights)]))})
    assert landmarks.altitude(estimator, HOME) is None  # not solved yet
    estimator.estimate.surveys[4] = 0.9
    altitude = landmarks.altitude(estimator, HOME)
    assert (altitude.landmark, altitude.too_high_m) == (0, pytest.approx(1.75))
    assert altitude.sigma_m == pytest.approx(np.hypot(0.2, 0.05))
    assert landmarks.altitude(estimator, GroundReference(HeightReference.RANGE)) is None
    estimator.estimate.surveys[4] = 0.1
    assert landmarks.altitude(estimator, HOME) is None


@pytest.mark.parametrize(
    ("weight", "state", "off_m"), [(0.98, LandmarkState.USED, 0.0), (0.02, LandmarkState.LEFT_OUT, 0.5)]
)
def test_record_names_a_survey_that_the_solve_left_out(estimator, weight, state, off_m):
    landmarks = SmoothedLandmarks([MARK])
    assert landmarks.records(estimator)[0].state is LandmarkState.UNSEEN
    landmarks.add(sight(), 4, estimator, HOME)
    estimator.estimate.targets[4], estimator.estimate.surveys[4] = (3.3, -1.6, 0.0), weight
    record = landmarks.records(estimator)[0]
    assert (record.label, record.state) == ("mark", state)
    assert record.off_m == pytest.approx(off_m)


def test_snapshot_is_not_changed_by_later_sights(estimator):
    landmarks = SmoothedLandmarks([MARK])
    before = landmarks.copy()
    landmarks.add(sight(), 4, estimator, HOME)
    estimator.estimate.targets[4] = (3.0, -2.0, 0.0)
    assert before.records(estimator)[0].state is LandmarkState.UNSEEN
