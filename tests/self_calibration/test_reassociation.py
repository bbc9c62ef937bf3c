"""Kept measurements find their own targets once the delay is known."""

import msgspec
import numpy as np
import pytest
from simulated_flight import Flight
from simulated_world import World

from fwav_companion.self_calibration.delayed_poses import delayed_poses
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT, measurement_batch
from fwav_companion.self_calibration.reassociation import near_places, reassociated

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
