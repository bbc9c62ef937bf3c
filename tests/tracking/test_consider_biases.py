"""Fixes as measurements: scales of the biases, inflated noise, turned noise, other sensitivities; against numpy."""

import numpy as np
import pytest
from handmade import a_fix, vector
from msgspec.structs import replace
from scipy.spatial.transform import Rotation
from simulated_flight import priors

from fwav_companion.self_calibration.position_path import TELEMETRY_STEP_S
from fwav_companion.tracking.filters.consider_biases import (
    DOWN_FLOOR_M2,
    SENSITIVITY_SHARE,
    SENSITIVITY_STEP_S,
    ConsiderBiases,
    turned_toward,
)
from fwav_companion.tracking.filters.gates import GATE
from fwav_companion.tracking.filters.linearization import SENSITIVE, level_columns
from fwav_companion.types import BIAS_COUNT, Bias

ALL = priors(
    roll=0.01, pitch=0.02, position_north=1.0, position_east=2.0, height=0.5, position_delay=0.05,
    attitude_noise=0.004, position_noise_m=0.3, height_noise_m=0.2,
)  # fmt: skip
SIGMAS = np.array(ALL.bias_sigmas)
IN_ORDER = [bias for bias in Bias if SIGMAS[bias] > 0 and bias not in (Bias.POSITION_NORTH, Bias.POSITION_EAST)]
"""The biases with a prior; the square of the time offset and the wandering ones follow."""


def drawn(seed, t=1.0, **detection):
    """A fix with any covariance and sensitivities, ten metres below the camera."""
    rng = np.random.default_rng(seed)
    root = rng.normal(0.0, 0.3, (3, 3))
    return a_fix(t, (6.0, -4.0, 0.1), root @ root.T, rng.normal(0.0, 3.0, (3, BIAS_COUNT)), SIGMAS, **detection)


def jacobian_of(fix):
    return np.array(fix.bias_jacobian).T


def scaled(fix, *wandering):
    """(3, count) sensitivities in sigmas; zero for the time offset's square: no turning."""
    standing = jacobian_of(fix)[:, IN_ORDER] * SIGMAS[IN_ORDER]
    return np.hstack((standing, np.zeros((3, 1)), jacobian_of(fix)[:, wandering] * SIGMAS[list(wandering)]))


def test_a_fix_has_a_column_for_each_bias_with_a_prior_and_the_wandering_ones_come_last():
    fix, errors = drawn(1), ConsiderBiases(ALL)
    prepared = errors.prepared(fix)
    assert np.array(prepared.shared) == pytest.approx(scaled(fix, Bias.POSITION_NORTH, Bias.POSITION_EAST))
    assert np.array(prepared.noise) == pytest.approx(np.array(fix.noise_cov) + np.diag([0.0, 0.0, DOWN_FLOOR_M2]))
    assert (errors.curved, errors.wandering, errors.count) == (len(IN_ORDER), len(IN_ORDER) + 1, len(IN_ORDER) + 3)
    assert errors.timed == IN_ORDER.index(Bias.TIME_OFFSET)
    standing = ConsiderBiases(ALL, wandering=False)
    assert np.array(standing.prepared(fix).shared) == pytest.approx(scaled(fix))
    assert (standing.wandering, standing.count) == (len(IN_ORDER) + 1, len(IN_ORDER) + 1)


def test_by_delay_are_the_two_sensitivities_of_the_position_delay():
    fix, errors = drawn(2), ConsiderBiases(ALL)
    i, north, east = errors.by_delay(errors.prepared(fix))
    expected = jacobian_of(fix)[:2, Bias.POSITION_DELAY] * SIGMAS[Bias.POSITION_DELAY]
    assert i == IN_ORDER.index(Bias.POSITION_DELAY)
    assert (north, east) == pytest.approx(tuple(expected))
    none = ConsiderBiases(priors())
    assert none.by_delay(none.prepared(fix)) is None
    exact = ConsiderBiases(priors(time_offset=0))
    assert (exact.timed, exact.curved) == (None, None)


def test_a_turning_vehicle_is_displaced_by_the_time_offset_to_second_order_too():
    fix, errors = drawn(11), ConsiderBiases(ALL)
    state = replace(fix.sighting.state, angular_acceleration=(20.0, -30.0, 0.0))
    fix = replace(fix, position_ned=(0.0, 0.0, 0.0), sighting=replace(fix.sighting, state=state))
    plain, found = errors.prepared(fix), errors.at_own_ray(errors.prepared(fix), fix, 0.1)
    more = np.subtract(found.shared, plain.shared)
    expected = np.zeros_like(more)
    expected[:2, errors.curved] = np.array([-30.0, -20.0]) * 10.0 * SIGMAS[Bias.TIME_OFFSET] ** 2 / np.sqrt(2.0)
    assert more == pytest.approx(expected, rel=1e-4)
    elsewhere = errors.relinearized(plain, fix, level_columns(fix, 3.0, 2.0, 8.0), 0.1)
    assert [row[errors.curved] for row in elsewhere.shared] == [row[errors.curved] for row in found.shared]
    shares = errors.shares(found.shared[:2])
    both = [IN_ORDER.index(Bias.TIME_OFFSET), errors.curved]
    assert shares[Bias.TIME_OFFSET] == pytest.approx(np.square(np.array(found.shared)[:2, both]).sum())
    assert len(shares) == errors.count - 1


def test_a_detectors_id_widens_the_gate():
    errors = ConsiderBiases(ALL)
    assert errors.prepared(drawn(4, detector_id=7)).gate == errors.prepared(drawn(3)).gate == GATE


def test_a_fix_is_prepared_once_and_the_memory_holds_one_frame():
    errors = ConsiderBiases(ALL)
    for frame in range(5):
        fixes = [drawn(5, t=1.0 + frame) for _ in range(3)]
        for fix in fixes:
            assert errors.prepared(fix) is errors.prepared(fix)
        assert len(errors._remembered) == len(fixes)
    equal = replace(fixes[-1])
    assert errors.prepared(equal) is not errors.prepared(fixes[-1]), "another fix at any address is another fix"


@pytest.mark.parametrize(("since_s", "spacing_s"), [(0.03, 0.0), (0.03, 0.25), (0.2, 0.25), (0.0, 0.25), (0.4, 0.25)])
def test_noise_that_fixes_share_counts_as_often_as_they_share_it(since_s, spacing_s):
    """Of n fixes with one sample of telemetry, the mean has the variance of one: each must claim n times that."""
    fix = drawn(6)
    state = replace(fix.sighting.state, spacing_s=spacing_s)
    fix = replace(fix, sighting=replace(fix.sighting, state=state))
    jacobian, expected = jacobian_of(fix), np.array(fix.noise_cov) + np.diag([0.0, 0.0, DOWN_FLOOR_M2])
    times = max(0.0, TELEMETRY_STEP_S / max(since_s, 1e-3) - 1.0)
    by_height = jacobian[:, Bias.HEIGHT] * 0.2
    expected += times * (np.outer(by_height, by_height) + 0.3**2 * np.diag([1.0, 1.0, 0.0]))
    times = max(0.0, spacing_s / max(since_s, 1e-3) - 1.0)
    for axis in (Bias.ROLL, Bias.PITCH, Bias.HEADING):
        by_turn = jacobian[:, axis] * 0.004
        expected += times * np.outer(by_turn, by_turn)
    measurement = ConsiderBiases(ALL).decorrelated(fix, since_s)
    assert np.array(measurement.noise) == pytest.approx(expected)
    assert measurement.shared == ConsiderBiases(ALL).prepared(fix).shared


def test_a_fix_long_after_the_last_one_is_itself():
    errors, fix = ConsiderBiases(ALL), drawn(7)
    assert errors.decorrelated(fix, TELEMETRY_STEP_S) is errors.prepared(fix)


@pytest.mark.parametrize("turn_deg", [-44.0, -10.0, 0.0, 30.0, 46.0, -60.0, 120.0, 180.0])
def test_noise_is_turned_into_the_azimuth_of_the_target_up_to_45_degrees(turn_deg):
    fix, turn = drawn(8), Rotation.from_euler("z", turn_deg, degrees=True)
    camera = np.array(fix.sighting.camera_ned)
    toward = camera + 2.5 * turn.apply(np.subtract(fix.position_ned, camera))
    noise, matrix3 = np.array(fix.noise_cov), turn.as_matrix()
    expected = matrix3 @ noise @ matrix3.T if abs(turn_deg) < 45.5 else noise
    assert np.array(turned_toward(fix.noise_cov, fix, vector(toward))) == pytest.approx(expected)
    errors = ConsiderBiases(ALL)
    measured = np.array(errors.decorrelated(fix, 9.0, vector(toward)).noise)
    assert measured == pytest.approx(expected + np.diag([0.0, 0.0, DOWN_FLOOR_M2]))


def test_straight_above_the_target_no_azimuth_matters():
    fix = drawn(9)
    over = (0.0, 0.0, 0.0)
    assert turned_toward(fix.noise_cov, fix, over) == fix.noise_cov


@pytest.mark.parametrize("since_s", [0.0, 0.1, 3.0, 60.0])
def test_other_sensitivities_replace_those_to_attitude_mount_and_height_and_add_their_own_error(since_s):
    fix, errors = drawn(10), ConsiderBiases(ALL)
    columns = level_columns(fix, 3.0, 2.0, 8.0)
    measurement = errors.prepared(fix)
    found = errors.relinearized(measurement, fix, columns, since_s)
    expected = scaled(fix, Bias.POSITION_NORTH, Bias.POSITION_EAST)
    own = np.zeros((2, 2))
    for bias, column in zip(SENSITIVE, columns, strict=True):
        if bias not in IN_ORDER:
            continue
        by_bias = np.array(column) * SIGMAS[bias]
        expected[:2, IN_ORDER.index(bias)] = by_bias
        own += SENSITIVITY_SHARE**2 * np.outer(by_bias, by_bias)
    assert np.array(found.shared) == pytest.approx(expected)
    repeats = max(1.0, SENSITIVITY_STEP_S / max(since_s, 1e-3))
    more = np.subtract(found.noise, measurement.noise)
    assert more[:2, :2] == pytest.approx(repeats * own)
    assert not more[2].any()
    again = errors.at_own_ray(replace(measurement, shared=found.shared), fix, since_s)
    assert np.array(again.noise) == pytest.approx(np.array(found.noise))
