"""What an association returns and compares: likelihood ratios from densities in the image, and who is asked."""

from math import exp, log, pi

import numpy as np
import pytest
from handmade import a_fix
from msgspec.structs import replace
from scipy.optimize import linear_sum_assignment
from scipy.stats import multivariate_normal

from fwav_companion.tracking.association import associate
from fwav_companion.tracking.clutter import LEAST_NOISE_PX2, Clutter, clutter, noise_area_px2
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.filters.gates import GATE
from fwav_companion.tracking.pair_costs import Candidate
from fwav_companion.types.tracks import GateResult

IMAGE_PX2 = 640.0 * 480.0
AGAINST = clutter(DetectorModel(), IMAGE_PX2)
PLACE = (4.0, 3.0, 0.0)


class Predicted:
    """A target with this result of its gate; counts how often it is asked."""

    def __init__(self, nis, log_det_ratio=0.0):
        self._result, self.asked = GateResult(nis, log_det_ratio), 0

    relative_cov = ((0.0,) * 3,) * 3

    def gate(self, _fix):
        self.asked += 1
        return self._result


def projected(fix, point):
    """Pixels of a point of the ground, by the ray's derivatives: 0.0015 of its depth a pixel."""
    north, east, down = np.subtract(point, fix.sighting.camera_ned)
    return np.array([north / down / 0.0015, east / down / 0.0015])


def test_the_noise_of_a_fix_as_an_area_of_the_image():
    """Straight below the camera, by numbers: 2 pi sqrt(det R) of the ground, at the scale of the image there."""
    noise = np.array([[0.04, 0.01, 0.0], [0.01, 0.09, 0.0], [0.0, 0.0, 0.0]])
    fix = a_fix(0.0, (0.0, 0.0, 0.0), noise)
    centre, step = projected(fix, (0.0, 0.0, 0.0)), 1e-4
    along_n = (projected(fix, (step, 0.0, 0.0)) - centre) / step
    along_e = (projected(fix, (0.0, step, 0.0)) - centre) / step
    px2_a_m2 = abs(np.linalg.det([along_n, along_e]))
    assert noise_area_px2(fix) == pytest.approx(2.0 * pi * np.sqrt(np.linalg.det(noise[:2, :2])) * px2_a_m2, rel=1e-6)


def test_a_detection_that_claims_to_be_perfect_is_not_believed():
    assert noise_area_px2(a_fix(0.0, PLACE, np.zeros((3, 3)))) == LEAST_NOISE_PX2
    assert noise_area_px2(a_fix(0.0, PLACE, 1e-12 * np.eye(3))) == LEAST_NOISE_PX2


def test_the_ratio_is_that_of_the_predicted_density_and_of_clutter_in_the_image():
    """Both as densities in the image: the prediction's normal density at the fix, and false detections a square pixel.

    The probability of a detection over a miss belongs to the life of the track, not to the fix.
    """
    noise, spread = 0.04 * np.eye(2), 0.25 * np.eye(2)
    fix = a_fix(0.0, (0.0, 0.0, 0.0), np.diag([0.04, 0.04, 0.0]))
    innovation = np.array([0.5, -0.3])
    nis = innovation @ np.linalg.solve(spread, innovation)
    target = Predicted(nis, log(np.linalg.det(spread) / np.linalg.det(noise)))
    ((_, (_, llr)),) = associate([Candidate("", target, None)], [fix], AGAINST).pairs.items()
    px2_a_m2 = noise_area_px2(fix) / (2.0 * pi * 0.04)
    density_a_px2 = multivariate_normal([0.0, 0.0], spread).pdf(innovation) / px2_a_m2
    assert llr == pytest.approx(log(density_a_px2 / (DetectorModel().false_per_frame / IMAGE_PX2)))


def test_an_equal_id_decides_between_pairs_of_similar_distance_and_adds_nothing_to_the_evidence():
    """The bonus is that of the prior persistence of ids, 0.8: 2.8 in units of the NIS."""
    fix = a_fix(0.0, (0.0, 0.0, 0.0), np.diag([0.04, 0.04, 0.0]), detector_id=5)
    near, same, far = Predicted(0.1), Predicted(2.0), Predicted(4.0)
    pairs = associate([Candidate("", near, None), Candidate("", same, 5)], [fix], AGAINST).pairs
    assert list(pairs) == [1]
    without = associate([Candidate("", same, None)], [fix], AGAINST).pairs
    assert pairs[1][1] == without[0][1]
    assert list(associate([Candidate("", near, None), Candidate("", far, 5)], [fix], AGAINST).pairs) == [0]
    assert associate([Candidate("", Predicted(GATE + 0.1), 5)], [fix], AGAINST).pairs == {}


def test_a_rare_detection_costs_its_odds_and_a_likely_one_nothing():
    assert clutter(DetectorModel(detection_probability=0.2), IMAGE_PX2).detection_odds == pytest.approx(2.0 * log(0.25))
    assert clutter(DetectorModel(detection_probability=0.8), IMAGE_PX2).detection_odds == 0.0
    assert clutter(DetectorModel(), 1000.0).false_per_px2 == pytest.approx(1e-4)
    sure = Clutter(false_per_px2=1e-6, detection_odds=-3.0)
    fix = a_fix(0.0, PLACE)
    assert exp(-0.5 * sure.llr_of(fix)) == pytest.approx(1e-6 * noise_area_px2(fix))


def test_the_slower_prediction_is_asked_only_where_there_is_a_choice():
    lone, first, second = (Candidate("", Predicted(1.0), None, refined=Predicted(2.0)) for _ in range(3))
    apart = replace(lone, label="person")
    fixes = [a_fix(0.0, PLACE), a_fix(0.0, PLACE, label="person")]
    associate([first, second, apart], fixes, AGAINST)
    assert (first.refined.asked, second.refined.asked, apart.refined.asked) == (1, 1, 0)
    two = [a_fix(0.0, PLACE), a_fix(0.0, (4.1, 3.0, 0.0))]
    associate([lone], two, AGAINST)
    assert lone.refined.asked == 2, "one track, two fixes"


def test_the_slower_prediction_decides():
    by_filter, by_refined = Predicted(0.5), Predicted(9.0)
    first = Candidate("", by_filter, None, refined=by_refined)
    second = Candidate("", Predicted(3.0), None)
    assert list(associate([first, second], [a_fix(0.0, PLACE)], AGAINST).pairs) == [1]
    outside = Candidate("", Predicted(0.5), None, refined=Predicted(GATE + 1.0))
    assert list(associate([outside, second], [a_fix(0.0, PLACE)], AGAINST).pairs) == [1]


class At:
    """A target on a line to the north, with a standard deviation of 1 m."""

    def __init__(self, north):
        self.north = north

    def gate(self, fix):
        return GateResult((fix.position_ned[0] - self.north) ** 2, 0.0)


def test_more_fixes_and_tracks_than_pairs_are_assigned_at_the_least_cost():
    """The nearest neighbour of the first track alone would leave the second without a fix."""
    places = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]
    tracks = [Candidate("", At(0.6), None), Candidate("", At(2.0), None)]
    found = associate(tracks, [a_fix(0.0, place) for place in places], AGAINST).pairs
    assert {i: j for i, (j, _) in found.items()} == {0: 0, 1: 1}


@pytest.mark.parametrize("seed", range(20))
def test_pairs_with_and_without_a_rival_are_together_at_the_least_cost(seed):
    rng = np.random.default_rng(seed)
    norths, places = np.append(rng.uniform(0.0, 40.0, 8), 90.0), np.append(rng.uniform(0.0, 40.0, 10), 91.0)
    fixes = [a_fix(0.0, (north, 0.0, 0.0)) for north in places]
    nis = np.subtract.outer(norths, places) ** 2
    costs = np.where(nis < GATE, nis - [AGAINST.llr_of(fix) for fix in fixes], 0.0)
    possible = costs < 0.0
    assert possible[-1].sum() == 1
    assert possible.sum(axis=0).max() > 1
    rows, columns = linear_sum_assignment(np.minimum(costs, 0.0))
    wanted = {i: j for i, j in zip(rows, columns, strict=True) if possible[i, j]}
    found = associate([Candidate("", At(north), None) for north in norths], fixes, AGAINST).pairs
    assert {i: j for i, (j, _) in found.items()} == wanted
    assert list(found) == sorted(found)
