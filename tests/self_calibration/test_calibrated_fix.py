"""A single fix without what the estimated parameters make of it: right where they are."""

from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.self_calibration import SharedParameter
from fwav_companion.self_calibration.assessment import CalibratedPlace
from fwav_companion.self_calibration.calibrated_fix import fix_by, known_parameters
from fwav_companion.self_calibration.calibration_state import CalibrationState
from fwav_companion.types import BIAS_COUNT, Bias

TARGET = (4.0, 3.0)
SMALL = {
    Bias.TIME_OFFSET: 0.3, Bias.MOUNT_X: 0.02, Bias.MOUNT_Y: -0.02, Bias.MOUNT_Z: 0.03,
    Bias.HEADING: 0.03, Bias.HEIGHT: 0.4,
}  # fmt: skip

CALIBRATED = (*SMALL, Bias.READOUT, Bias.LEVER_X, Bias.LEVER_Y, Bias.LEVER_Z)

LEAST_M = 0.1
EXACT, NOISY = priors(height_noise_m=0.0), priors(position_noise_m=0.1, height_noise_m=0.0)


def fixes_with(biases):
    values = np.zeros(BIAS_COUNT)
    for bias, value in biases.items():
        values[bias] = value
    quiet = {"pixel_px": 0.0, "flapping_deg": 0.0, "late_by": 0.0, "priors": priors(attitude_noise=0.0)}
    shape = "eight" if Bias.TIME_OFFSET in biases else "hover"
    flight = Flight(seconds=2.0, shape=shape, height_m=10.0, targets=(TARGET,), biases=values, **quiet)
    return [fix for view in World(flight).frames() for fix in view.fixes]


def parameters(biases):
    """The parameters of a world with these biases, and their covariance when they are known to a hundredth.

    The world turns its true mount by the opposite of its bias.
    """
    mean = np.zeros(len(SharedParameter))
    for shared, bias, sign in (
        (SharedParameter.DELAY, Bias.TIME_OFFSET, 1.0), (SharedParameter.MOUNT_X, Bias.MOUNT_X, -1.0),
        (SharedParameter.MOUNT_Y, Bias.MOUNT_Y, -1.0), (SharedParameter.MOUNT_Z, Bias.MOUNT_Z, -1.0),
        (SharedParameter.HEADING, Bias.HEADING, 1.0), (SharedParameter.HEIGHT, Bias.HEIGHT, 1.0),
    ):  # fmt: skip
        mean[shared] = sign * biases.get(bias, 0.0)
    return mean, np.eye(len(mean)) * 1e-4


@pytest.mark.parametrize("bias", list(SMALL))
def test_each_parameter_takes_out_what_its_bias_makes(bias):
    """The world projects with the bias, the fix is corrected with the parameter: the second order is left."""
    only = {bias: SMALL[bias]}
    fixes, known = fixes_with(only), parameters(only)
    found = [known_parameters(*known, EXACT).corrected(fix) for fix in fixes]
    off = np.hypot(*(np.mean([fix.position_ned[:2] for fix in fixes], 0) - TARGET))
    left = np.hypot(*(np.mean([(each.north, each.east) for each in found], 0) - TARGET))
    assert off > LEAST_M
    assert left < 0.02 + 0.1 * off


def test_the_claim_holds_noise_and_parameters_but_not_the_position():
    fix = fixes_with({})[0]
    mean, cov = parameters({})
    noise, by = np.array(fix.noise_cov)[:2, :2], np.array([fix.bias_jacobian[bias][:2] for bias in CALIBRATED])
    found = known_parameters(mean, cov, NOISY).corrected(fix)
    expected = noise - 0.01 * np.eye(2) + 1e-4 * by.T @ by
    assert found.cov == pytest.approx((expected[0, 0], expected[0, 1], expected[1, 1]))


def test_a_fix_is_taken_without_the_noise_of_the_height_that_the_path_shows():
    """The height is reported too high; a path that shows this is right, and its own noise is left."""
    high_m, left = SMALL[Bias.HEIGHT], 0.05**2
    fixes, smoothed = fixes_with({Bias.HEIGHT: high_m}), ((0.0, 0.0, -high_m), (0.0, 0.0, left))
    known = known_parameters(*parameters({}), priors(height_noise_m=0.1))
    found = [known.corrected(fix, smoothed) for fix in fixes]
    assert np.hypot(*(np.mean([fix.position_ned[:2] for fix in fixes], 0) - TARGET)) > LEAST_M
    assert np.hypot(*(np.mean([(each.north, each.east) for each in found], 0) - TARGET)) < 0.03
    by_height = np.array(fixes[0].bias_jacobian[Bias.HEIGHT][:2])
    less = np.array(known.corrected(fixes[0]).cov) - found[0].cov
    north, east = by_height
    assert less == pytest.approx((0.1**2 - left) * np.array((north * north, north * east, east * east)))
    ranged = msgspec.structs.replace(fixes[0], ground="rangefinder")
    assert known.corrected(ranged, smoothed) == known.corrected(ranged)


def a_place(place_m):
    """A place of the joint estimate with this sigma."""
    square = (place_m**2, 0.0, place_m**2)
    return CalibratedPlace(0.0, 0.0, square, 4.0, 3.0, square)


def by_path(fix, place_m, off=(0.0, 0.0, 0.0)):
    """The same at a fix, along a path that shows the noise of the report."""
    return a_place(place_m).along_path(fix.sighting.state, (off, (0.01**2, 0.02**2, 0.0)))


@pytest.mark.parametrize(("place_m", "chosen"), [(1.0, True), (0.01, False)])
def test_the_fix_is_chosen_where_it_claims_less_than_the_place(place_m, chosen):
    fix, known = fixes_with({})[0], known_parameters(*parameters({}), EXACT)
    expected = known.corrected(fix)
    assert 0.02**2 < expected.claimed_m2 < 1.0
    found = fix_by(fix, known, by_path(fix, place_m), 2.0 * place_m**2 + 0.01)
    assert (found == expected) is chosen


def test_the_fix_alone_is_taken_where_the_position_does_not_wander_smoothly():
    """However little the place claims: it lags behind."""
    fix, known = fixes_with({})[0], known_parameters(*parameters({}), EXACT)
    passes = SimpleNamespace(served=SimpleNamespace(wanders_quickly=True))
    context = SimpleNamespace(smoothed_report=lambda path, vehicle: None)
    assessment, motion = SimpleNamespace(known=known), SimpleNamespace(path=None)
    state = SimpleNamespace(assessment=assessment, passes=passes, motion=motion, context=context)
    assert CalibrationState.by_fix(state, fix, a_place(0.01), 1e-6) == known.corrected(fix)


def test_the_fix_is_chosen_without_a_path():
    fix, known = fixes_with({})[0], known_parameters(*parameters({}), EXACT)
    assert a_place(0.01).along_path(fix.sighting.state, None) is None
    assert fix_by(fix, known, None, 1.0) == known.corrected(fix)


def test_the_place_is_taken_without_the_noise_of_the_report_that_the_path_shows():
    fix, known = fixes_with({})[0], known_parameters(*parameters({}), NOISY)
    found = fix_by(fix, known, by_path(fix, 0.03, off=(0.2, -0.1, 0.3)), 2.0 * (0.03**2 + 0.1**2))
    assert (found.north, found.east) == pytest.approx((4.2, 2.9))
    assert found.cov == pytest.approx((0.03**2 + 0.01**2, 0.0, 0.03**2 + 0.02**2))


def test_neither_is_taken_where_more_is_known_without_the_fix():
    fix, known = fixes_with({})[0], known_parameters(*parameters({}), EXACT)
    assert fix_by(fix, known, by_path(fix, 0.03), 1e-6) is None
