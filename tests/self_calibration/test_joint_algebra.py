"""The geometry of self-calibration by differences, and its algebra by a batch fit."""

import msgspec
import numpy as np
import pytest
from handmade import BOOT_NS
from pixel_covariances import pixel_noise
from scipy.spatial.transform import Rotation
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.self_calibration import SharedParameter
from fwav_companion.self_calibration.delayed_poses import delayed_poses
from fwav_companion.self_calibration.filter_pass import filter_pass
from fwav_companion.self_calibration.joint_filter import joint_filter
from fwav_companion.self_calibration.measurement_batch import measurement_batch
from fwav_companion.self_calibration.pixel_innovations import innovations
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT, camera_pose, predict


def some_batches(count=40):
    """Single measurements of one target."""
    flight = Flight(seconds=8, shape="hover", height_m=10.0, targets=((4.0, 3.0),), pixel_px=0.5)
    world = World(flight)
    fixes = [fix for view in world.frames() for fix in view.fixes][:: max(1, 200 // count)][:count]
    return [
        measurement_batch([(1, fix)], delayed_poses([fix.sighting.state], (0.0,), world.state_at), (0.2,))
        for fix in fixes
    ]


def predicted(batch, target, shared):
    return predict(batch, np.array([[target]], float), np.array([shared], float))


def test_what_was_before_the_first_position_is_no_place():
    """Before the first position the vehicle's place is unknown, not the origin: a camera on the ground under its own
    targets sees nothing.
    """
    world = World(Flight(seconds=3, shape="hover", height_m=10.0, targets=((4.0, 3.0),)))
    nominal = next(fix for view in world.frames() for fix in view.fixes).sighting.state

    def state_at(boot_ns):
        state = world.state_at(boot_ns)
        return msgspec.structs.replace(state, position_ned=None) if boot_ns < nominal.boot_ns - 50_000_000 else state

    poses = delayed_poses([nominal], (-0.03, 0.0, 0.03, 0.06, 0.09), state_at)
    assert poses.delay_s.tolist() == [[-0.03, 0.0, 0.03]]
    assert poses.at(np.array([0.15])).position_ned[0, 2] == pytest.approx(-10.0, abs=1.0)


def test_the_rows_of_a_frame_share_the_states_around_its_first():
    world = World(Flight(seconds=3, flapping_hz=5.0, targets=((4.0, 3.0),)))
    states = [world.state_at(BOOT_NS + 10**9 + k * 3_000_000) for k in range(4)]
    poses = delayed_poses(states, (-0.012, 0.0, 0.012), world.state_at).at(np.full(4, 0.004))
    for k, state in enumerate(states):
        exact = delayed_poses([state], (0.004,), world.state_at)
        assert poses.ned_from_body[k] == pytest.approx(exact.ned_from_body[0, 0], abs=2e-3)
        assert poses.position_ned[k] == pytest.approx(exact.position_ned[0, 0], abs=0.01)


def test_a_target_square_to_the_ray_is_no_prediction():
    """Its Jacobian rows are unbounded: the prediction's variance exceeds the rounding of the pixel's own noise."""
    shared = np.zeros((1, SHARED_COUNT))
    sigmas = np.array((0.05, *np.radians([1.0, 1.0, 1.0, 2.0]), *[0.0] * 6))
    batch = min(some_batches(10), key=lambda each: abs(each.drop_m[0]))
    point = camera_pose(batch, shared).ground_points(batch.ray)[0][0, 0]
    camera = batch.poses.position_ned[0, 0]
    ray = np.array([point[0] - camera[0], point[1] - camera[1], batch.drop_m[0]])
    ray /= np.linalg.norm(ray)
    aside = ray[:2] / np.hypot(*ray[:2])
    square = (
        -batch.drop_m[0] * ray[2] / np.hypot(*ray[:2])
    )  # at this distance along the ray's own azimuth it is at a right angle
    reported = 0
    for short in np.concatenate([[0.0], np.logspace(-9, 1.3, 40)]):
        joint = joint_filter(priors(), sigmas, shared, shared).with_target(
            1, camera[None, :2] + (square + short) * aside
        )
        cov = joint.cov.copy()
        cov[0, [SHARED_COUNT, SHARED_COUNT + 1], [SHARED_COUNT, SHARED_COUNT + 1]] = 1.0
        seen = innovations(msgspec.structs.replace(joint, cov=cov), batch)
        if seen.valid[0, 0]:
            reported += 1
            common = seen.common[0, 0]
            noise = common @ common.T + np.diag(batch.pixel_sigma[0] ** 2)
            assert seen.determinant[0, 0] > np.linalg.det(noise) > 0.0
            assert 0.0 <= seen.nis[0, 0] < 1e6
        else:
            assert np.isinf(seen.nis[0, 0])
    assert 0 < reported < 41


def test_rows_are_the_differences_of_the_residual():
    shared = np.array([0.002, 0.01, -0.02, 0.03, 0.04, 0.3, 0.0, 0.02, 0.01, -0.02, 0.03])
    target = np.array([4.1, 3.2])
    for batch in some_batches(10):
        at = predicted(batch, target, shared).rows[0, 0]
        for i in range(SHARED_COUNT + 2):
            step = np.zeros(SHARED_COUNT + 2)
            step[i] = 1e-6
            sides = [
                predicted(batch, target + s * step[SHARED_COUNT:], shared + s * step[:SHARED_COUNT]).residual[0, 0]
                for s in (1, -1)
            ]
            tolerance = (
                1e-3 * np.abs(at[:, :SHARED_COUNT]).max(1)[0] if i in (1, 2, 3) else 1e-3
            )  # third order of the vector
            assert -(sides[0] - sides[1]) / 2e-6 == pytest.approx(at[:, i], rel=1e-4, abs=tolerance)


def test_the_ground_point_is_where_the_residual_vanishes():
    shared = np.array([[0.0, 0.01, -0.02, 0.03, 0.04, 0.3, 0.0, 0.02, 0.01, -0.02, 0.03]])
    for batch in some_batches(5):
        points, hits = camera_pose(batch, shared).ground_points(batch.ray)
        assert hits.all()
        assert predict(batch, points, shared).residual == pytest.approx(np.zeros((1, 1, 2)), abs=1e-6)


def test_measurements_between_the_same_two_attitudes_share_their_noise():
    batch = some_batches(2)[1]
    at = predicted(batch, (4.0, 3.0), np.zeros(SHARED_COUNT))

    def noise(spacing_s, since_s):
        spaced = msgspec.structs.replace(batch, attitude_spacing_s=np.array([spacing_s]), since_s=np.array([since_s]))
        return np.subtract(*(pixel_noise(spaced, at.rows, priors(attitude_noise=a)) for a in (0.01, 0.0)))

    alone = noise(0.02, 0.1)
    assert noise(0.02, 0.04) == pytest.approx(alone)
    assert noise(0.25, 0.1) == pytest.approx(2.5 * alone)


def test_the_joint_estimate_is_the_batch_fit():
    """Information added in numpy, with the same rows at the same linearization point."""
    p = priors(time_offset=0.01, height=0.5)
    sigmas = np.array((0.01, 0.0175, 0.0175, 0.0175, 0.035, 0.5, *[0.0] * 5))
    point, target = np.zeros((1, SHARED_COUNT)), (4.0, 3.0)
    joint = joint_filter(p, sigmas, point, point).with_target(1, np.array([target]))
    used = np.flatnonzero(sigmas)
    information, right = np.diag([*sigmas[used] ** -2, 1e-4, 1e-4]), np.zeros(len(used) + 2)
    places = [*used, SHARED_COUNT, SHARED_COUNT + 1]
    for batch in some_batches():
        seen = innovations(joint, batch)
        joint, *_ = joint.update(seen, seen.valid)
        at = predict(batch, np.array([[target]]), point)
        rows = at.rows[0, 0][:, places]
        weight = np.linalg.inv(pixel_noise(batch, at.rows, p)[0, 0])
        information += rows.T @ weight @ rows
        right += rows.T @ weight @ at.residual[0, 0]
    cov = np.linalg.inv(information)
    mean = joint.mean[0, places] - np.array([0.0] * len(used) + [4.0, 3.0])
    assert mean == pytest.approx(cov @ right, rel=1e-4, abs=1e-6)
    assert joint.cov[0][np.ix_(places, places)] == pytest.approx(cov, rel=1e-4, abs=1e-9)


def test_common_order():
    assert [c.name for c in SharedParameter][:6] == ["DELAY", "MOUNT_X", "MOUNT_Y", "MOUNT_Z", "HEADING", "HEIGHT"]


def test_one_gross_measurement_among_the_first_does_not_place_a_target():
    batches = some_batches()
    turn = Rotation.from_rotvec([0.15, 0.0, 0.0])
    first = batches[0]
    gross = msgspec.structs.replace(first, ray=turn.apply(first.ray), dual=turn.apply(first.dual[0])[None])
    sigmas, none = np.array((0.001, 0.001, 0.001, 0.001, 0.001, *[0.0] * 6)), np.zeros((1, SHARED_COUNT))
    fit = filter_pass(joint_filter(priors(), sigmas, none, none), {})
    for batch in (gross, *batches[1:]):
        fit = fit.fed(batch)
    assert fit.refused[0] == 1
    assert fit.joint.mean[0, SHARED_COUNT:] == pytest.approx((4.0, 3.0), abs=0.05)


def test_no_predicted_pixel_depends_on_the_others_of_its_batch_to_the_bit():
    """Else a replay would depend on how frames are gathered."""
    flight = Flight(seconds=8, shape="hover", height_m=10.0, targets=((4.0, 3.0),), pixel_px=0.5)
    world, rng, count = World(flight), np.random.default_rng(1), 9
    fixes = [fix for view in world.frames() for fix in view.fixes][::20][:count]
    poses = delayed_poses([fix.sighting.state for fix in fixes], (-0.02, 0.0, 0.02), world.state_at)
    batch = measurement_batch([(1, fix) for fix in fixes], poses, (0.2,) * count)
    shared = rng.normal(0.0, 0.01, (20, SHARED_COUNT))
    targets = np.array((4.0, 3.0)) + rng.normal(0.0, 0.1, (20, count, 2))
    together = predict(batch, targets, shared)
    for k in range(count):
        alone = predict(batch.take([k]), targets[:, [k]], shared)
        assert np.array_equal(alone.rows, together.rows[:, [k]])
        assert np.array_equal(alone.residual, together.residual[:, [k]])
    for h in range(20):
        assert np.array_equal(predict(batch, targets[[h]], shared[[h]]).rows, together.rows[[h]])
