"""A single fix without what the estimated parameters make of it: right where they are."""

from types import SimpleNamespace

import numpy as np
import pytest
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.self_calibration import SharedParameter
from fwav_companion.self_calibration.assessment import CalibratedPlace
from fwav_companion.self_calibration.calibrated_fix import COLUMNS, calibrated_fix, fix_by
from fwav_companion.types import BIAS_COUNT, Bias

TARGET = (4.0, 3.0)
SMALL = {
    Bias.TIME_OFFSET: 0.3, Bias.MOUNT_X: 0.02, Bias.MOUNT_Y: -0.02, Bias.MOUNT_Z: 0.03,
    Bias.HEADING: 0.03, Bias.HEIGHT: 0.4,
}  # fmt: skip

LEAST_M = 0.1


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
    found = [calibrated_fix(fix, *known, 0.0) for fix in fixes]
    off = np.hypot(*(np.mean([fix.position_ned[:2] for fix in fixes], 0) - TARGET))
    left = np.hypot(*(np.mean([(each.north, each.east) for each in found], 0) - TARGET))
    assert off > LEAST_M
    assert left < 0.02 + 0.1 * off


def test_the_claim_holds_noise_and_parameters_but_not_the_position():
    fix = fixes_with({})[0]
    mean, cov = parameters({})
    noise, by = np.array(fix.noise_cov)[:2, :2], np.array([fix.bias_jacobian[bias][:2] for _, bias, _ in COLUMNS])
    found = calibrated_fix(fix, mean, cov, 0.01)
    expected = noise - 0.01 * np.eye(2) + 1e-4 * by.T @ by
    assert found.cov == pytest.approx((expected[0, 0], expected[0, 1], expected[1, 1]))


def choosing(known, *, wanders_quickly, place_m, noise_m=0.0, off=(0.0, 0.0)):
    """A calibrator that has a place with this sigma, and a path that shows the noise of the report."""
    state = SimpleNamespace(
        assessment=SimpleNamespace(posterior=known),
        passes=SimpleNamespace(served=SimpleNamespace(wanders_quickly=wanders_quickly)),
        smoother=None,
        context=SimpleNamespace(
            priors=SimpleNamespace(position_noise_m=noise_m),
            smoothed_report=lambda _smoother, _vehicle: (off, (0.01**2, 0.02**2)),
        ),
    )
    square = (place_m**2, 0.0, place_m**2)
    return state, CalibratedPlace(0.0, 0.0, square, 4.0, 3.0, square)


@pytest.mark.parametrize(
    ("wanders_quickly", "place_m", "chosen"), [(False, 1.0, True), (False, 0.01, False), (True, 0.01, True)]
)
def test_the_fix_is_chosen_where_it_claims_less_than_the_place_or_the_position_wanders_quickly(
    wanders_quickly, place_m, chosen
):
    fix, known = fixes_with({})[0], parameters({})
    state, placed = choosing(known, wanders_quickly=wanders_quickly, place_m=place_m)
    expected = calibrated_fix(fix, *known, 0.0)
    assert 0.02**2 < expected.cov[0] + expected.cov[2] < 1.0
    found = fix_by(state, fix, placed, 2.0 * place_m**2 + 0.01)
    assert (found == expected) is chosen


def test_the_place_is_taken_without_the_noise_of_the_report_that_the_path_shows():
    fix, known = fixes_with({})[0], parameters({})
    state, placed = choosing(known, wanders_quickly=False, place_m=0.03, noise_m=0.1, off=(0.2, -0.1))
    found = fix_by(state, fix, placed, 2.0 * (0.03**2 + 0.1**2))
    assert (found.north, found.east) == pytest.approx((4.2, 2.9))
    assert found.cov == pytest.approx((0.03**2 + 0.01**2, 0.0, 0.03**2 + 0.02**2))


def test_neither_is_taken_where_more_is_known_without_the_fix():
    fix, known = fixes_with({})[0], parameters({})
    state, placed = choosing(known, wanders_quickly=False, place_m=0.03)
    assert fix_by(state, fix, placed, 1e-6) is None


def test_a_place_is_right_in_the_frame_of_a_late_report():
    """Sights alone: the target lies 2 m ahead of the true vehicle, which is by velocity times delay beyond its report.

    The apparent place errs with the delay, the place relative to the report does not: its variance is that of sights.
    """
    rng, velocity, sight_m, late_s = np.random.default_rng(4), np.array((3.0, -2.0, 0.0)), 0.02, 0.05
    delays = rng.normal(0.0, late_s, 20_000)
    apparent = np.array((2.0, 0.0)) + delays[:, None] * velocity[:2] + rng.normal(0.0, sight_m, (20_000, 2))
    joint = np.cov(np.column_stack((apparent, delays)).T)
    mean = 0.03 * velocity[:2] + (2.0, 0.0)
    cov, late_cov = joint[[0, 0, 1], [0, 1, 1]], joint[[0, 1, 2], 2]
    placed = CalibratedPlace(0.0, 0.0, (1.0, 0.0, 1.0), *mean, tuple(cov), 0.03, tuple(late_cov))
    north, east, (nn, ne, ee) = placed.relative_to(tuple(velocity))
    assert (north, east) == pytest.approx((2.0, 0.0))
    assert (nn, ee) == pytest.approx((sight_m**2, sight_m**2), rel=0.03)
    assert abs(ne) < 0.03 * sight_m**2
    assert cov[0] > 40.0 * nn
