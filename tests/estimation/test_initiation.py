"""Clusters of detections without a target, also of a mount that is wrong by quarter turns."""

import numpy as np
import pytest
from estimated_flights import Planted
from scipy.spatial.transform import Rotation
from simulated_flight import Flight

from fwav_companion.estimation.errors import SampleNoise, priors
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.initiation import cluster, quarter_turns, sight_poses
from fwav_companion.estimation.kept_sightings import Sightings, joined

TARGETS = ((1.0, 2.0), (-1.5, 1.0), (2.0, -2.0))
DOWN = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def seen():
    """Ten seconds of a turning flight, 40 ms late: the estimator with the telemetry, and the sightings."""
    flight = Flight(seconds=10.0, fps=4.7, shape="turns", height_m=10.0, pitch_deg=0.0, targets=TARGETS,
                    velocities=((0.0, 0.0),) * 3)  # fmt: skip
    planted = Planted(flight, np.array([0.04, *[0.0] * 11]))
    estimator = Estimator(priors(), SampleNoise())
    attitudes, positions = planted.telemetry()
    for sample in attitudes:
        estimator.add_attitude(*sample)
    for sample in positions:
        estimator.add_position(*sample)
    return estimator, joined([s for _, s in planted.frames()])


def turned(s, vector):
    """The sightings of a camera whose configured mount is wrong by a rotation vector."""
    rotation = Rotation.from_rotvec(vector).as_matrix()
    return Sightings(s.t, rotation @ s.rays, np.einsum("ian,ba->ibn", s.tangents, rotation), s.frame, s.target, s.row)


def clustered(estimator, s, shared, turn=None, sigma2=1e-8, **options):
    """Clusters at shared parameters that are known but for this variance."""
    poses = sight_poses(estimator.carrier, s, shared)
    return cluster(estimator.model, poses, s, shared, np.eye(13) * sigma2, np.zeros(3), turn, **options)


def purity(found, s):
    """Share of the clustered detections that belong to their cluster's most frequent target."""
    right = sum(np.bincount(s.target[c.members]).max() for c in found.clusters)
    return right / sum(len(c.members) for c in found.clusters)


def test_clusters_at_the_true_calibration_are_the_targets(seen):
    estimator, s = seen
    shared = np.zeros(13)
    shared[0] = 0.04
    found = clustered(estimator, s, shared)
    assert len(found.clusters) == 3
    assert purity(found, s) > 0.98
    places = sorted(tuple(c.place) for c in found.clusters)
    assert np.array(places) == pytest.approx(np.array(sorted(TARGETS)), abs=0.1)


@pytest.mark.parametrize("turn", [0, 1, 2, 3])
def test_turned_mount_explains_most_detections_before_the_first_solve(seen, turn):
    estimator, s = seen
    turns, prior = quarter_turns(DOWN)[:4], estimator.model.priors.sigma**2
    seen_turned = turned(s, turns[turn])
    found = [clustered(estimator, seen_turned, np.zeros(13), each, np.diag(prior)) for each in turns]
    best = max(found, key=lambda each: each.score)
    assert best.turn == pytest.approx(turns[turn])
    assert purity(best, seen_turned) > 0.9


def test_clustering_that_cannot_beat_a_score_ends_and_one_that_can_is_unchanged(seen):
    estimator, s = seen
    shared, turns = np.zeros(13), quarter_turns(DOWN)
    shared[0] = 0.04
    right = clustered(estimator, s, shared)
    wrong = clustered(estimator, s, shared, turns[1], beats=right.score)
    assert not wrong.clusters
    assert wrong.score < right.score
    again = clustered(estimator, s, shared, beats=right.score - 1.0)
    assert again.score == right.score


def test_quarter_turns_are_different_rotations():
    turns = quarter_turns(DOWN)
    matrices = Rotation.from_rotvec(turns).as_matrix()
    assert len(turns) == 10
    for i in range(len(turns)):
        for j in range(i):
            assert np.abs(matrices[i] - matrices[j]).max() > 0.5


def test_one_detection_of_a_frame_joins_a_cluster_once(seen):
    estimator, s = seen
    twice = joined([s.select(s.frame == k) for k in np.unique(s.frame).repeat(2)])
    shared = np.zeros(13)
    shared[0] = 0.04
    found = clustered(estimator, twice, shared)
    for c in found.clusters:
        assert len(np.unique(twice.frame[c.members])) == len(c.members)
