"""Gates of the joint estimate: against dense matrices and pixels, and after a gap against the textbook's transition."""

import msgspec
import numpy as np
import pytest
from joint_estimates import FIRST, POSITION, PRIORS, SHARED, TRACKS, a_hover, batch_of, joint_with, some_fixes
from pixel_covariances import pixel_noise

from fwav_companion.self_calibration.calibration_context import CalibrationContext
from fwav_companion.self_calibration.calibrator import Calibrator
from fwav_companion.self_calibration.delayed_poses import delayed_poses
from fwav_companion.self_calibration.filter_pass import filter_pass
from fwav_companion.self_calibration.frame_fixes import GroundGate
from fwav_companion.self_calibration.measurement_batch import measurement_batch
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT, camera_pose, predict
from fwav_companion.self_calibration.relinearization import Relinearization
from fwav_companion.types import Bias, Reason, Unpaired

STEP = 1e-6
UNPAIRED = Unpaired(Reason.BEFORE_HISTORY)


def densely(joint, batch, place):
    """Residual, its covariance, and that of the noise alone, with the rows by differences about the mean."""
    at = FIRST + 2 * place
    taken = [*range(SHARED_COUNT), at, at + 1]
    point, columns = joint.mean[0, taken], []
    point[SHARED_COUNT:] += POSITION[:2]
    for step in STEP * np.eye(SHARED_COUNT + 2):
        ahead, behind = (
            predict(batch, x[None, None, SHARED_COUNT:], x[None, :SHARED_COUNT]).residual[0, 0]
            for x in (point + step, point - step)
        )
        columns.append((behind - ahead) / (2.0 * STEP))
    rows = np.array(columns).T
    there = predict(batch, point[None, None, SHARED_COUNT:], point[None, :SHARED_COUNT])
    noise = pixel_noise(batch, there.rows, joint.priors)[0, 0]
    full = np.zeros((2, joint.mean.shape[1]))
    full[:, taken] = rows
    full[:, SHARED_COUNT : SHARED_COUNT + 2] = rows[:, SHARED_COUNT:]
    return there.residual[0, 0], noise + full @ joint.cov[0] @ full.T, noise


def test_gates_of_a_flapping_vehicle_are_nearly_those_in_pixels():
    """About the mean, in pixels: the gate compares points on the ground, with the sensitivities of the fixes."""
    world = a_hover()
    fixes = some_fixes(world)
    assert len(fixes) > 5
    for seed, fix in enumerate(fixes):
        rng, batch = np.random.default_rng(seed), batch_of([(0, fix)], world, (0.0,))
        point = camera_pose(batch, SHARED).ground_points(batch.ray)[0][0, 0]
        joint = joint_with(point + rng.uniform(-0.3, 0.3, (3, 2)), rng)
        gate = GroundGate(joint, [fix], world.state_at)
        for place in range(3):
            residual, cov, noise = densely(joint, batch, place)
            found = gate.gate(place, 0)
            assert found.nis == pytest.approx(residual @ np.linalg.solve(cov, residual), rel=0.2, abs=0.05)
            assert found.log_det_ratio == pytest.approx(np.log(np.linalg.det(cov) / np.linalg.det(noise)), abs=0.5)


def test_gates_of_a_vehicle_at_rest_are_those_of_dense_matrices_on_the_ground():
    """Points by the chain of a batch, and the fixes' own Jacobians in the order of the shared parameters."""
    order = [Bias.TIME_OFFSET, Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z, Bias.HEADING, Bias.HEIGHT, Bias.READOUT]
    order += [Bias.POSITION_DELAY, Bias.LEVER_X, Bias.LEVER_Y, Bias.LEVER_Z]
    signs = np.where(np.array(order) == Bias.READOUT, -1.0, 1.0)
    for seed, fix in enumerate(some_fixes(a_hover())):
        rest = msgspec.structs.replace(fix.sighting.state, rates=(0.0, 0.0, 0.0), velocity_ned=(0.0, 0.0, 0.0))
        poses = delayed_poses([rest], (0.0,), lambda _, rest=rest: rest)
        rng, batch = np.random.default_rng(seed), measurement_batch([(0, fix)], poses, (0.0,))
        point = camera_pose(batch, SHARED).ground_points(batch.ray)[0][0, 0]
        joint = joint_with(point + rng.uniform(-3.0, 3.0, (3, 2)), rng)
        gate = GroundGate(joint, [fix], lambda _, rest=rest: rest)
        noise, rows = np.array(fix.noise_cov)[:2, :2], np.array(fix.bias_jacobian)[order, :2].T * signs
        for place in range(3):
            at, full = FIRST + 2 * place, np.zeros((2, joint.mean.shape[1]))
            full[:, :SHARED_COUNT] = rows
            full[:, SHARED_COUNT : SHARED_COUNT + 2] = full[:, at : at + 2] = np.eye(2)
            off, cov = point - joint.mean[0, at : at + 2] - POSITION[:2], noise + full @ joint.cov[0] @ full.T
            found = gate.gate(place, 0)
            assert found.nis == pytest.approx(off @ np.linalg.solve(cov, off), rel=1e-3)
            expected = np.log(np.linalg.det(cov) / np.linalg.det(noise))
            assert found.log_det_ratio == pytest.approx(expected, abs=1e-3)


def estimating(joint, world):
    """Self-calibration with this joint estimate, which is assessed."""
    passes = Relinearization(served=filter_pass(joint, {}))
    return Calibrator(CalibrationContext(PRIORS, world.state_at), passes=passes)._assessed()


@pytest.mark.parametrize("gap_s", [0.6, 9.0, 40.0])
def test_after_a_gap_gates_and_places_allow_for_the_wander_in_it(gap_s):
    """Critically damped, with the angular frequency 2 / 60 s: (1 + w t) exp(-w t) of the error is left, and t exp(-w t)
    of its rate (Gelb 1974, ch. 2). Its own variance is stationary.
    """
    world, rng = a_hover(), np.random.default_rng(1)
    fix = some_fixes(world)[3]
    joint = joint_with(np.array([[4.0, 3.0], [4.2, 3.1], [3.9, 2.8]]), rng)
    # Known exactly at the last sight: the error and its rate.
    moving, cov, mean = slice(SHARED_COUNT, FIRST), joint.cov.copy(), joint.mean.copy()
    cov[:, moving], cov[:, :, moving] = 0.0, 0.0
    mean[:, moving] = (0.3, -0.2, 0.01, 0.02)
    joint = msgspec.structs.replace(joint, mean=mean, cov=cov)
    w, left, by_rate = 2.0 / 60.0, (1.0 + gap_s / 30.0) * np.exp(-gap_s / 30.0), gap_s * np.exp(-gap_s / 30.0)
    grown = 0.25 * (1.0 - left**2 - (w * by_rate) ** 2)
    afterwards = mean.copy()
    afterwards[:, SHARED_COUNT : SHARED_COUNT + 2] = left * mean[:, moving][:, :2] + by_rate * mean[:, moving][:, 2:]
    wider = cov.copy()
    wider[:, [SHARED_COUNT, SHARED_COUNT + 1], [SHARED_COUNT, SHARED_COUNT + 1]] = grown
    expected = estimating(msgspec.structs.replace(joint, mean=afterwards, cov=wider), world)
    frame_ns = fix.sighting.frame_host_ns
    before = estimating(msgspec.structs.replace(joint, host_ns=frame_ns - round(gap_s * 1e9)), world)
    predicted = before.predicted(frame_ns)
    for track in TRACKS:
        one, other = predicted.gate(track, fix), expected.gate(track, fix)
        assert one.nis == pytest.approx(other.nis, rel=2e-3)
        assert one.log_det_ratio == pytest.approx(other.log_det_ratio, abs=2e-3)
        one, other, seen = (each.placed(track) for each in (predicted, expected, before))
        assert (one.apparent_north, one.apparent_east) == pytest.approx(
            (other.apparent_north, other.apparent_east), abs=2e-3
        )
        assert one.relative_cov == pytest.approx(other.relative_cov, rel=2e-3)
        assert one.relative_cov[0] == pytest.approx(seen.relative_cov[0] + grown, rel=2e-3)
        assert (one.north, one.east) == pytest.approx((seen.north, seen.east))
        assert one.cov == pytest.approx(seen.cov)


def test_what_lies_above_the_horizon_is_outside_every_gate():
    world, rng = a_hover(), np.random.default_rng(0)
    fix = some_fixes(world)[0]
    ray = msgspec.structs.replace(fix.sighting.ray, direction=tuple(-x for x in fix.sighting.ray.direction))
    skyward = msgspec.structs.replace(fix, sighting=msgspec.structs.replace(fix.sighting, ray=ray))
    for _ in range(8):  # with covariances of north and east of either sign
        gate = GroundGate(joint_with(rng.normal(size=(3, 2)), rng), [fix, skyward], world.state_at)
        assert all(np.isfinite(gate.gate(place, 0).nis) for place in range(3))
        assert all(np.isinf(gate.gate(place, 1).nis) for place in range(3))


def test_without_the_vehicles_state_there_is_no_gate():
    world, rng = a_hover(), np.random.default_rng(0)
    gate = GroundGate(joint_with(rng.normal(size=(3, 2)), rng), some_fixes(world)[:1], lambda _: UNPAIRED)
    assert gate.gate(0, 0) is None
