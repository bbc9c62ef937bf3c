"""One pixel measurement compared with many targets: against dense matrices and numerical derivatives."""

import msgspec
import numpy as np
import pytest
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.self_calibration.delayed_poses import delayed_poses
from fwav_companion.self_calibration.joint_filter import joint_of
from fwav_companion.self_calibration.pixel_measurement import COMMON_COUNT, pixel_measurement, pixel_noise, predict
from fwav_companion.self_calibration.prepared_measurement import compared

COMMON = (0.003, 0.01, -0.02, 0.015, 0.02, 0.2, 0.0, 0.1, -0.15)
SIGMAS = (0.004, 0.01, 0.008, 0.02, 0.03, 0.2, 0.0, 0.5, 0.5)
ELSEWHERE = (0.0,) * COMMON_COUNT
"""The linearization point of the estimate: no comparison may depend on it."""
TRACKS = (3, 5, 8)
STEP = 1e-6


def some_glimpses():
    world = World(Flight(seconds=6, shape="hover", height_m=10.0, targets=((4.0, 3.0),), pixel_px=0.5))
    fixes = [fix for view in world.frames() for fix in view.fixes][::20]
    return [pixel_measurement(0, fix, delayed_poses(fix.sighting.state, (0.0,), world.state_at), 0.0) for fix in fixes]


def joint_with(places, rng):
    """A joint estimate of targets whose errors are correlated with one another and with the shared parameters."""
    size = COMMON_COUNT + places.size
    root = np.diag([*SIGMAS, *[0.3] * places.size]) @ (np.eye(size) + 0.3 * rng.normal(size=(size, size)))
    return msgspec.structs.replace(
        joint_of(priors(), SIGMAS, COMMON, ELSEWHERE),
        mean=(*COMMON, *places.ravel().tolist()),
        cov=tuple(map(tuple, (root @ root.T).tolist())),
        around=(*ELSEWHERE, *(places.ravel() + 0.5).tolist()),
        tracks=TRACKS,
    )


def ground_point(glimpse):
    return np.array(compared(joint_with(np.zeros((3, 2)), np.random.default_rng(0)), glimpse).point)


def rows_by_differences(glimpse, target):
    """d(residual)/d(common, target)."""
    at, columns = np.array([*COMMON, *target]), []
    for step in STEP * np.eye(COMMON_COUNT + 2):
        ahead, behind = (
            predict(glimpse, tuple(x[COMMON_COUNT:]), tuple(x[:COMMON_COUNT])) for x in (at + step, at - step)
        )
        columns.append((np.array(ahead.residual) - np.array(behind.residual)) / (2.0 * STEP))
    return np.array(columns).T


def densely(joint, glimpse, place):
    """Residual, its covariance, and that of the noise alone, linearized at the means."""
    at = COMMON_COUNT + 2 * place
    target, taken = joint.mean[at : at + 2], [*range(COMMON_COUNT), at, at + 1]
    rows, there = rows_by_differences(glimpse, target), predict(glimpse, target, COMMON)
    uu, uv, vv = pixel_noise(glimpse, there, joint.priors)
    noise = np.array([[uu, uv], [uv, vv]])
    return np.array(there.residual), noise + rows @ np.array(joint.cov)[np.ix_(taken, taken)] @ rows.T, noise


def test_near_targets_are_as_surprising_as_dense_matrices_have_it():
    """Within a hand's breadth the rows are still those of the point where the ray meets the ground."""
    glimpses = some_glimpses()
    assert len(glimpses) > 5
    for seed, glimpse in enumerate(glimpses):
        rng = np.random.default_rng(seed)
        joint = joint_with(ground_point(glimpse) + rng.uniform(-0.1, 0.1, (3, 2)), rng)
        comparison = compared(joint, glimpse)
        for place, track in enumerate(TRACKS):
            residual, cov, noise = densely(joint, glimpse, place)
            seen = comparison.gate(track)
            assert seen.nis == pytest.approx(residual @ np.linalg.solve(cov, residual), rel=0.05)
            assert seen.log_det_ratio == pytest.approx(np.log(np.linalg.det(cov) / np.linalg.det(noise)), abs=0.05)


def test_a_far_target_is_as_many_pixels_off_as_geometry_has_it():
    """With the same covariance of the estimate at every place, distances grow as the squares of pixels."""
    for seed, glimpse in enumerate(some_glimpses()):
        rng = np.random.default_rng(seed)
        joint = joint_with(ground_point(glimpse) + rng.uniform(-6.0, 6.0, (3, 2)), rng)
        sure = msgspec.structs.replace(joint, cov=tuple(map(tuple, (1e-18 * np.eye(len(joint.mean))).tolist())))
        comparison = compared(sure, glimpse)
        at_point = predict(glimpse, comparison.point, COMMON)
        uu, uv, vv = pixel_noise(glimpse, at_point, sure.priors)
        for place, track in enumerate(TRACKS):
            residual, _, _ = densely(sure, glimpse, place)
            expected = residual @ np.linalg.solve([[uu, uv], [uv, vv]], residual)
            assert comparison.gate(track).nis == pytest.approx(expected, rel=1e-6)


def test_what_is_not_there_is_not_compared():
    rng, glimpse = np.random.default_rng(0), some_glimpses()[0]
    joint = joint_with(rng.normal(size=(3, 2)), rng)
    comparison = compared(joint, glimpse)
    assert comparison.gate(4) is None
    camera, toward = np.array(glimpse.course.at(0.0).position_ned[:2]), np.array(comparison.receding)
    behind = camera - 1e3 * toward / np.hypot(*toward)
    moved = msgspec.structs.replace(
        joint, mean=(*joint.mean[:COMMON_COUNT], *behind.tolist(), *joint.mean[COMMON_COUNT + 2 :])
    )
    assert compared(moved, glimpse).gate(3) is None
    assert compared(joint_of(priors(), SIGMAS, COMMON, ELSEWHERE), glimpse) is None
    skyward = msgspec.structs.replace(glimpse, ray=tuple(-x for x in glimpse.ray))
    assert compared(joint, skyward) is None
