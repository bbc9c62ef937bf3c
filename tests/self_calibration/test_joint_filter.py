"""Measurement batches and the joint filter: against dense matrices, derivatives by differences, and one another."""

import msgspec
import numpy as np
import pytest
from joint_estimates import (
    FIRST,
    POSITION,
    PRIORS,
    SHARED,
    SIGMAS,
    TRACKS,
    a_hover,
    batch_of,
    joint_with,
    some_fixes,
)
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.self_calibration import joint_filter as joint_filter_module
from fwav_companion.self_calibration.delayed_poses import delayed_poses
from fwav_companion.self_calibration.joint_filter import joint_filter
from fwav_companion.self_calibration.measurement_batch import joined, measurement_batch
from fwav_companion.self_calibration.measurement_queue import MOST_SIGHTS
from fwav_companion.self_calibration.pixel_innovations import innovations, state_rows
from fwav_companion.self_calibration.pixel_measurement import DELAY, SHARED_COUNT, camera_pose, common_noise, predict
from fwav_companion.self_calibration.position_error import QUICK, SMOOTH


def some_batches():
    """Single measurements of one target, of different frames."""
    world = a_hover()
    return [batch_of([(0, fix)], world, (0.0,)) for fix in some_fixes(world)]


def a_frame():
    """Three targets in one frame, with rows that are captured one after another."""
    world = World(Flight(seconds=4, shape="hover", height_m=10.0, targets=((4.0, 3.0),), pixel_px=0.5))
    fix = [fix for view in world.frames() for fix in view.fixes][40]
    fixes = []
    for k, track in enumerate(TRACKS):
        sighting = msgspec.structs.replace(
            fix.sighting, state=world.state_at(fix.sighting.boot_ns + k * 5_000_000), row_fraction=0.3 * k
        )
        fixes.append((track, msgspec.structs.replace(fix, sighting=sighting)))
    states = [each.sighting.state for _, each in fixes]
    return measurement_batch(fixes, delayed_poses(states, (-0.015, 0.0, 0.015), world.state_at), (0.1,) * 3)


def predicted_at_point(joint, batch):
    """The pixels of the three targets of a frame, predicted at the linearization point."""
    point = joint.linearization_point
    return predict(batch, point[:, SHARED_COUNT:].reshape(1, 3, 2), point[:, :SHARED_COUNT])


def rows_at_point(joint, batch):
    return state_rows(joint, predicted_at_point(joint, batch), range(3))


def test_a_prediction_depends_on_its_own_measurement_alone():
    """Not one bit changes with the size or the order of a batch."""
    batch, targets = a_frame(), np.array([[[4.0, 3.0], [4.1, 3.2], [3.7, 2.9]]])
    whole = predict(batch, targets, SHARED)
    for index in ([0], [2], [1, 0], [2, 0, 1], [0, 1, 2, 1, 0]):
        part = predict(batch.take(index), targets[:, index], SHARED)
        assert np.array_equal(part.residual, whole.residual[:, index])
        assert np.array_equal(part.rows, whole.rows[:, index])
        noise = common_noise(batch.take(index), part.rows, PRIORS)
        assert np.array_equal(noise, common_noise(batch, whole.rows, PRIORS)[:, index])
    many = predict(batch, np.tile(targets, (7, 1, 1)), np.tile(SHARED, (7, 1)))
    assert np.array_equal(many.rows, np.tile(whole.rows, (7, 1, 1, 1)))


def test_a_hypothesis_depends_on_no_other():
    batch, rng = a_frame(), np.random.default_rng(3)
    joint = joint_with(np.array([[4.0, 3.0], [4.1, 3.2], [3.7, 2.9]]), rng, hypotheses=5)
    seen = innovations(joint, batch)
    after, score, _ = joint.update(seen, seen.valid)
    for k in range(5):
        alone = joint.take([k])
        own = innovations(alone, batch)
        one, its_score, _ = alone.update(own, own.valid)
        assert np.array_equal(one.mean[0], after.mean[k])
        assert np.array_equal(one.cov[0], after.cov[k])
        assert its_score[0] == score[k]


def test_one_batch_is_as_good_as_one_measurement_after_another():
    """Measurements of different frames share no noise: together and one by one they give the same estimate."""
    batches = [msgspec.structs.replace(each, tracks=(TRACKS[k % 3],)) for k, each in enumerate(some_batches()[:6])]
    joint = joint_with(np.array([[4.0, 3.0], [4.1, 3.1], [3.9, 2.9]]), np.random.default_rng(2))
    seen = innovations(joint, joined(batches))
    together, score, _ = joint.update(seen, seen.valid)
    one_by_one, total = joint, 0.0
    for batch in batches:
        seen = innovations(one_by_one, batch)
        one_by_one, each, _ = one_by_one.update(seen, seen.valid)
        total += each[0]
    assert one_by_one.mean == pytest.approx(together.mean, rel=1e-9, abs=1e-12)
    assert one_by_one.cov == pytest.approx(together.cov, rel=1e-7, abs=1e-13)
    assert total == pytest.approx(score[0], rel=1e-9)


@pytest.mark.parametrize(("enough", "shows_height"), [(3, True), (4, True), (3, False)])
def test_an_update_is_that_of_the_schmidt_kalman_filter(enough, shows_height, monkeypatch):
    """K = P H' inv(S) with a row of zero for a considered height, and the covariance in Joseph's form."""
    monkeypatch.setattr(joint_filter_module, "ENOUGH_TARGETS", enough)
    batch = a_frame()
    joint = joint_with(np.array([[4.0, 3.0], [4.1, 3.2], [3.7, 2.9]]), np.random.default_rng(4))
    joint = msgspec.structs.replace(joint, shows_height=shows_height)
    estimated = enough == 3 and shows_height
    assert joint.considers_height is not estimated
    seen = innovations(joint, batch)
    after, *_ = joint.update(seen, seen.valid)
    rows, cov = rows_at_point(joint, batch)[0], joint.cov[0]
    noise = seen.cov[0] - rows @ cov @ rows.T
    gain = cov @ rows.T @ np.linalg.inv(seen.cov[0])
    gain[5] *= estimated
    keep = np.eye(len(cov)) - gain @ rows
    assert after.mean[0] == pytest.approx(joint.mean[0] + gain @ seen.difference[0], rel=1e-9, abs=1e-12)
    assert after.cov[0] == pytest.approx(keep @ cov @ keep.T + gain @ noise @ gain.T, rel=1e-6, abs=1e-10)


def test_targets_of_one_frame_share_the_noise_of_its_telemetry():
    """A frame's attitude errs alike for all its targets: many of them show it no better than one."""
    batch = a_frame()
    joint = joint_with(np.array([[4.0, 3.0], [4.1, 3.2], [3.7, 2.9]]), np.random.default_rng(4))
    seen = innovations(joint, batch)
    rows = rows_at_point(joint, batch)[0]
    noise = seen.cov[0] - rows @ joint.cov[0] @ rows.T
    common = common_noise(batch, predicted_at_point(joint, batch).rows, PRIORS)
    assert noise[0, 2] == pytest.approx(common[0, 0, 0] @ common[0, 1, 0], rel=1e-6)
    assert abs(noise[0, 2]) > 0.0


@pytest.mark.parametrize("kind", [QUICK, SMOOTH])
def test_a_wandering_position_keeps_its_variance_and_forgets_itself(kind):
    """Stationary from the start, and its correlation is that of the process's two poles."""
    priors_ = priors(position_north=0.5, position_east=0.5, position_bias_time_s=20.0)
    joint = joint_filter(priors_, SIGMAS, SHARED, SHARED, (kind,)).predict(1_000_000_000)
    joint = msgspec.structs.replace(joint, mean=joint.mean + np.eye(1, FIRST, SHARED_COUNT))
    after, seconds = joint, 0.0
    for seconds in (0.5, 1.5, 7.0):
        after = after.predict(1_000_000_000 + int(seconds * 1e9))
        assert after.cov == pytest.approx(joint.cov, rel=1e-9, abs=1e-12)
    w = 0.1
    expected = (1.0 + w * seconds) * np.exp(-w * seconds) if kind == SMOOTH else np.exp(-seconds / 20.0)
    assert after.position_error[0] == pytest.approx([expected, 0.0], abs=0.06 if kind == QUICK else 1e-3)


def test_the_linearization_point_moves_where_the_estimate_left_it_in_view():
    """On a descent the first guess of a target is degrees off."""
    batch = a_frame()
    places = camera_pose(batch, SHARED).ground_points(batch.ray)[0][0] - POSITION[:2]
    joint = joint_with(places, np.random.default_rng(4))
    moved = joint.relinearized(batch)
    point = moved.linearization_point.copy()
    point[:, SHARED_COUNT:] += 0.5
    far = msgspec.structs.replace(joint, linearization_point=point)
    assert innovations(moved, batch).displaced < 1e-9
    assert innovations(far, batch).displaced > 0.02
    exact = predict(batch, moved.apparent.reshape(1, 3, 2), moved.mean[:, :SHARED_COUNT]).residual
    assert innovations(moved, batch).difference == pytest.approx(exact.reshape(1, -1), abs=1e-9)


@pytest.mark.parametrize(("delay_s", "stays"), [(0.02, True), (0.002, False)])
def test_the_linearization_point_of_the_delay_stays_where_the_vehicle_turns_far_within_its_change(delay_s, stays):
    """At 2 rad/s by 2.3 degrees in 20 ms, and by a tenth of it in 2 ms."""
    batch = a_frame()
    rates = np.broadcast_to([0.0, 2.0, 0.0], batch.poses.rates.shape)
    batch = msgspec.structs.replace(batch, poses=msgspec.structs.replace(batch.poses, rates=rates))
    joint = joint_with(np.array([[4.0, 3.0], [4.1, 3.2], [3.7, 2.9]]), np.random.default_rng(4))
    before, mean = joint.linearization_point[:, DELAY], joint.mean.copy()
    mean[:, DELAY] = before + delay_s
    after = msgspec.structs.replace(joint, mean=mean).relinearized(batch).linearization_point
    assert after[:, DELAY] == pytest.approx(before if stays else before + delay_s, abs=1e-15)
    assert (after[:, DELAY + 1 : SHARED_COUNT] == mean[:, DELAY + 1 : SHARED_COUNT]).all()


def test_places_are_displaced_alike_by_a_position_error_alone():
    places = np.array([[4.0, 3.0], [4.1, 3.2], [3.7, 2.9]])
    joint = joint_with(places, np.random.default_rng(4), 2)
    noise = 0.1 * np.random.default_rng(5).normal(size=joint.mean.shape)
    joint = msgspec.structs.replace(joint, mean=joint.mean + noise)
    before, after = joint.linearization_point, joint.displaced().linearization_point
    moved = (after - before)[:, SHARED_COUNT:].reshape(2, 3, 2)
    assert (after == before)[:, :SHARED_COUNT].all()
    assert moved == pytest.approx(np.tile(moved[:, :1], (1, 3, 1)), abs=1e-12)
    left = (joint.apparent - after[:, SHARED_COUNT:]).reshape(2, 3, 2).mean(1)
    assert left == pytest.approx(np.zeros((2, 2)), abs=1e-12)
    for alone in (joint.without(TRACKS[0]).without(TRACKS[1]), joint_filter(priors(), SIGMAS, SHARED, SHARED)):
        assert alone.displaced() is alone


def test_the_separation_of_two_targets_is_that_of_their_difference():
    """Against draws of the state: what both share moves both and cancels."""
    places = np.array([[4.0, 3.0], [4.1, 3.2], [9.0, -2.0]])
    rng = np.random.default_rng(4)
    joint = joint_with(places, rng)
    a, b = FIRST, FIRST + 2
    drawn = rng.multivariate_normal(joint.mean[0], joint.cov[0], 20_000)
    apart = drawn[:, a : a + 2] - drawn[:, b : b + 2]
    mean, cov = joint.mean[0, a : a + 2] - joint.mean[0, b : b + 2], np.cov(apart.T)
    assert joint.separation2(TRACKS[0], TRACKS[1]) == pytest.approx(mean @ np.linalg.solve(cov, mean), rel=0.05)
    assert joint.separation2(TRACKS[0], 99) == np.inf


OPENBLAS_SERIAL = 65536 * 4
"""Products of matrices of up to as many multiplications are by one thread (OpenBLAS, interface/gemm.c)."""


def test_no_matrix_of_a_batch_of_ten_targets_is_divided_among_threads():
    """Users' own programs do not set BLAS to one thread, as the commands do."""
    rows, states = 2 * MOST_SIGHTS, FIRST + 2 * 10
    assert rows * states * max(rows, states) <= OPENBLAS_SERIAL
