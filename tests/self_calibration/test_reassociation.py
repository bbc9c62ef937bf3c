"""Kept measurements find their own targets once the delay is known."""

import msgspec
import numpy as np
import pytest
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.self_calibration.delayed_poses import delayed_poses
from fwav_companion.self_calibration.filter_pass import WORST, filter_pass
from fwav_companion.self_calibration.joint_filter import joint_filter
from fwav_companion.self_calibration.measurement_batch import measurement_batch
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT
from fwav_companion.self_calibration.reassociation import Trial, near_places, reassociated

TARGETS = ((4.0, 3.0), (4.0, 1.0))
PLACES = {k + 1: np.array(place) for k, place in enumerate(TARGETS)}
POINT = np.zeros(SHARED_COUNT)
ALIKE = {1: "pad", 2: "pad"}


@pytest.fixture(scope="module")
def batches():
    """Batches of both targets, on their own tracks."""
    still = {"velocities": ((0.0, 0.0),) * 2, "labels": ("", ""), "flapping_deg": 0.0}
    world = World(Flight(seconds=1.0, shape="hover", height_m=10.0, targets=TARGETS, pixel_px=0.5, **still))
    found = []
    for view in world.frames():
        own = {min(PLACES, key=lambda k: np.hypot(*(PLACES[k] - fix.position_ned[:2]))): fix for fix in view.fixes}
        if len(own) == 2:
            fixes = sorted(own.items())
            poses = delayed_poses([fix.sighting.state for _, fix in fixes], (0.0,), world.state_at)
            found.append(measurement_batch(fixes, poses, (0.03, 0.03)))
    assert found
    return found


def tracked(batch, *tracks):
    return msgspec.structs.replace(batch, tracks=tracks)


def test_exchanged_measurements_return_to_their_targets(batches):
    for batch in batches:
        again = reassociated(tracked(batch, 2, 1), POINT, PLACES, ALIKE)
        assert again.tracks == (1, 2)
        assert np.array_equal(again.ray, batch.ray)


def test_right_ones_stay_as_they_are(batches):
    assert all(reassociated(batch, POINT, PLACES, ALIKE) is batch for batch in batches)


def test_of_two_measurements_of_one_target_the_nearer_stays(batches):
    doubled = tracked(batches[0].take([0, 0]), 1, 2)
    again = reassociated(doubled, POINT, PLACES, ALIKE)
    assert again.tracks == (1,)


def test_labels_are_kept_apart(batches):
    wrong = tracked(batches[0], 2, 1)
    assert reassociated(wrong, POINT, PLACES, {1: "pad", 2: "cow"}) is wrong


def test_only_targets_of_a_kind_near_to_one_another_are_associated_again():
    places = PLACES | {3: np.array((40.0, 0.0)), 4: np.array((4.0, 2.0))}
    assert near_places(places, {**ALIKE, 3: "pad", 4: "cow"}, 10.0).keys() == {1, 2}
    assert near_places(places, {**ALIKE, 3: "pad", 4: "cow"}, 5.0) == {}


def a_trial():
    shared, sigmas = np.zeros((1, SHARED_COUNT)), np.full(SHARED_COUNT, 0.01)
    return Trial(filter_pass(joint_filter(priors(), sigmas, shared, shared), {}), PLACES)


def fed(trial, batches):
    for batch in batches:
        trial = trial.fed(batch, ALIKE)
    return trial.estimate


def test_a_trial_is_as_good_with_exchanged_measurements_as_without(batches):
    exchanged = [tracked(batch, 2, 1) if k % 3 == 0 else batch for k, batch in enumerate(batches)]
    right, again = fed(a_trial(), batches), fed(a_trial(), exchanged)
    assert right.score == pytest.approx(again.score)
    assert again.joint.targets[1][0] == pytest.approx(TARGETS[0], abs=0.2)
    assert again.fits[0]


def test_a_measurement_without_a_target_is_charged_as_the_worst(batches):
    doubled = tracked(batches[-1].take([0, 0]), 1, 2)
    single, lost = (
        fed(a_trial(), [*batches[:-1], tracked(batches[-1].take([0]), 1)]),
        fed(a_trial(), [*batches[:-1], doubled]),
    )
    charge = 0.5 * WORST + np.log(batches[-1].pixel_sigma[0].prod())
    assert single.score - lost.score == pytest.approx(charge)
    assert lost.refused - single.refused == 1


def test_a_trial_without_a_target_exchanges_nothing_with_it(batches):
    trial = a_trial().without([2])
    assert trial.places.keys() == {1}
    assert fed(trial, [tracked(batch.take([1]), 2) for batch in batches]).joint.tracks == (2,)
