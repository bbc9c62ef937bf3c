"""A single fix without what the estimated parameters make of it: right where they are."""

from math import inf
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.geometry.vectors import add
from fwav_companion.self_calibration import SharedParameter
from fwav_companion.self_calibration.calibrated_fix import CalibratedFix, known_parameters
from fwav_companion.self_calibration.calibrated_places import CalibratedPlace
from fwav_companion.self_calibration.calibration_context import CalibrationContext
from fwav_companion.self_calibration.calibration_state import CalibrationState
from fwav_companion.self_calibration.frame_fixes import FrameFixes
from fwav_companion.self_calibration.measurement_queue import DelayedMeasurement, MeasurementQueue
from fwav_companion.types import BIAS_COUNT, Bias, Reason, Unpaired

TARGET = (4.0, 3.0)
SMALL = {
    Bias.TIME_OFFSET: 0.3, Bias.MOUNT_X: 0.02, Bias.MOUNT_Y: -0.02, Bias.MOUNT_Z: 0.03,
    Bias.HEADING: 0.03, Bias.HEIGHT: 0.4,
}  # fmt: skip

CALIBRATED = (*SMALL, Bias.READOUT, Bias.LEVER_X, Bias.LEVER_Y, Bias.LEVER_Z)

LEAST_M = 0.1
ON_PATH = ((0.0, 0.0, 0.0), (0.01**2, 0.02**2, 0.0))
"""A report of the vehicle without noise, and the variance of what the path shows of that."""
EXACT, NOISY = priors(height_noise_m=0.0), priors(position_noise_m=0.1, height_noise_m=0.0)


def fixes_with(biases):
    return [fix for view in a_world(biases).frames() for fix in view.fixes]


def a_world(biases, **changes):
    values = np.zeros(BIAS_COUNT)
    for bias, value in biases.items():
        values[bias] = value
    quiet = {"pixel_px": 0.0, "flapping_deg": 0.0, "late_by": 0.0, "priors": priors(attitude_noise=0.0)}
    shape = "eight" if Bias.TIME_OFFSET in biases else "hover"
    shaped = {"seconds": 2.0, "shape": shape, "height_m": 10.0, "targets": (TARGET,), "biases": values}
    return World(Flight(**shaped | quiet | changes))


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


def linearly(known, fix, smoothed=None):
    """The fix by its sensitivities at the nominal capture."""
    return FrameFixes([fix], None).alone(fix, known, smoothed, inf)


@pytest.mark.parametrize("bias", list(SMALL))
def test_each_parameter_takes_out_what_its_bias_makes(bias):
    """The world projects with the bias, the fix is corrected with the parameter: the second order is left."""
    only = {bias: SMALL[bias]}
    fixes, known = fixes_with(only), parameters(only)
    found = [linearly(known_parameters(*known, EXACT), fix) for fix in fixes]
    off = np.hypot(*(np.mean([fix.position_ned[:2] for fix in fixes], 0) - TARGET))
    left = np.hypot(*(np.mean([(each.north, each.east) for each in found], 0) - TARGET))
    assert off > LEAST_M
    assert left < 0.02 + 0.1 * off


def test_the_claim_holds_noise_and_parameters_but_not_the_position():
    fix = fixes_with({})[0]
    mean, cov = parameters({})
    noise, by = np.array(fix.noise_cov)[:2, :2], np.array([fix.bias_jacobian[bias][:2] for bias in CALIBRATED])
    found = linearly(known_parameters(mean, cov, NOISY), fix)
    expected = noise - 0.01 * np.eye(2) + 1e-4 * by.T @ by
    assert found.cov == pytest.approx((expected[0, 0], expected[0, 1], expected[1, 1]))


def test_a_fix_is_taken_without_the_noise_of_the_height_that_the_path_shows():
    """The height is reported too high; a path that shows this is right, and its own noise is left."""
    high_m, left = SMALL[Bias.HEIGHT], 0.05**2
    fixes, smoothed = fixes_with({Bias.HEIGHT: high_m}), ((0.0, 0.0, -high_m), (0.0, 0.0, left))
    known = known_parameters(*parameters({}), priors(height_noise_m=0.1))
    found = [linearly(known, fix, smoothed) for fix in fixes]
    assert np.hypot(*(np.mean([fix.position_ned[:2] for fix in fixes], 0) - TARGET)) > LEAST_M
    assert np.hypot(*(np.mean([(each.north, each.east) for each in found], 0) - TARGET)) < 0.03
    by_height = np.array(fixes[0].bias_jacobian[Bias.HEIGHT][:2])
    less = np.array(linearly(known, fixes[0]).cov) - found[0].cov
    north, east = by_height
    assert less == pytest.approx((0.1**2 - left) * np.array((north * north, north * east, east * east)))
    ranged = msgspec.structs.replace(fixes[0], ground="rangefinder")
    assert linearly(known, ranged, smoothed) == linearly(known, ranged)


def a_place(place_m):
    """A place of the joint estimate with this sigma."""
    square = (place_m**2, 0.0, place_m**2)
    return CalibratedPlace(0.0, 0.0, square, 4.0, 3.0, square)


def by_fix(fix, known, placed, claimed_m2, **state):
    """The fix by the state of self-calibration."""
    return a_state(known, placed, **state).by_fix(1, fix, claimed_m2)


def a_state(known, placed, *, report=None, state_at=None, wanders_quickly=False, queue=None):
    """The state of self-calibration. ``report``: noise and variance of the vehicle's, by the path."""
    return CalibrationState(
        CalibrationContext(known.priors, state_at),
        queue=queue or MeasurementQueue(),
        present=SimpleNamespace(wanders_quickly=wanders_quickly),
        motion=SimpleNamespace(path=SimpleNamespace(report=lambda vehicle, priors: report)),
        assessment=SimpleNamespace(known=known, places={1: placed}),
    )


@pytest.mark.parametrize(("place_m", "chosen"), [(1.0, True), (0.01, False)])
def test_the_fix_is_chosen_where_it_claims_less_than_the_place(place_m, chosen):
    fix, known = fixes_with({})[0], known_parameters(*parameters({}), EXACT)
    expected = linearly(known, fix, ON_PATH)
    assert 0.02**2 < expected.claimed_m2 < 1.0
    found = by_fix(fix, known, a_place(place_m), 2.0 * place_m**2 + 0.01, report=ON_PATH)
    assert found is not None
    assert (found == expected) is chosen


def test_the_fix_alone_is_taken_where_the_position_does_not_wander_smoothly():
    """However little the place claims: it lags behind."""
    fix, known = fixes_with({})[0], known_parameters(*parameters({}), EXACT)
    found = by_fix(fix, known, a_place(0.01), 1e-6, report=ON_PATH, wanders_quickly=True)
    assert found == linearly(known, fix, ON_PATH)


def queued(*fixes):
    """These fixes of one track, each in a frame of its own."""
    queue = MeasurementQueue()
    for fix in fixes:
        queue = queue.with_frame(DelayedMeasurement(fix.sighting.frame_host_ns, ((1, fix),)))
    return queue


def test_a_fix_that_contradicts_the_path_is_taken_only_where_the_one_before_shows_the_same():
    """A false detection is alone; after a jump of the vehicle's position all fixes show it."""
    before, fix = fixes_with({})[:2]
    elsewhere = msgspec.structs.replace(before, position_ned=add(before.position_ned, (0.0, 1.0, 0.0)))
    known, placed = known_parameters(*parameters({}), EXACT), a_place(0.05)
    alone = linearly(known, fix, ON_PATH)
    by = {"report": ON_PATH, "wanders_quickly": True}
    assert by_fix(fix, known, placed, 9.0, queue=queued(fix), **by) == alone
    jumped = msgspec.structs.replace(placed, apparent_east=2.0)
    along = jumped.along_path(fix.sighting.state, ON_PATH)
    assert by_fix(fix, known, jumped, 9.0, **by) == along
    assert by_fix(fix, known, jumped, 9.0, queue=queued(fix), **by) == along
    assert by_fix(fix, known, jumped, 9.0, queue=queued(elsewhere, fix), **by) == along
    assert by_fix(fix, known, jumped, 9.0, queue=queued(before, fix), **by) == alone
    assert by_fix(fix, known, jumped, 9.0, queue=queued(before), **by) == alone


def test_places_agree_by_the_covariance_of_both():
    one, other = CalibratedFix(1.0, 2.0, (0.04, 0.01, 0.09)), (0.01, -0.02, 0.16)
    both = np.array(((0.05, -0.01), (-0.01, 0.25)))
    for angle in np.radians(range(0, 360, 30)):
        edge = np.linalg.cholesky(both) @ (np.cos(angle), np.sin(angle)) * np.sqrt(13.8)
        inside, outside = (CalibratedFix(1.0 + k * edge[0], 2.0 + k * edge[1], other) for k in (0.99, 1.01))
        assert one.agrees_with(inside)
        assert not one.agrees_with(outside)


def test_the_fix_is_chosen_without_a_path():
    fix, known = fixes_with({})[0], known_parameters(*parameters({}), EXACT)
    assert by_fix(fix, known, a_place(0.01), 1.0) == linearly(known, fix)


def test_the_place_is_taken_without_the_noise_of_the_report_that_the_path_shows():
    fix, known = fixes_with({})[0], known_parameters(*parameters({}), NOISY)
    report = ((0.2, -0.1, 0.3), ON_PATH[1])
    found = by_fix(fix, known, a_place(0.03), 2.0 * (0.03**2 + 0.1**2), report=report)
    assert (found.north, found.east) == pytest.approx((4.2, 2.9))
    assert found.cov == pytest.approx((0.03**2 + 0.01**2, 0.0, 0.03**2 + 0.02**2))


@pytest.mark.parametrize("report", [None, ON_PATH])
def test_without_a_fix_a_place_has_the_delay_and_the_noise_of_the_vehicles_report(report):
    """At 5 m/s a report that is 0.1 s late is half a metre behind; its noise counts where no path shows it."""
    vehicle = msgspec.structs.replace(fixes_with({})[0].sighting.state, velocity_ned=(3.0, -4.0, 0.0))
    placed = msgspec.structs.replace(a_place(0.05), late_s=0.1, late_cov=(0.0, 0.0, 0.02**2))
    state = a_state(known_parameters(*parameters({}), NOISY), placed, report=report)
    found = state.in_report(1, vehicle)
    assert (found.north, found.east) == pytest.approx((4.0 - 0.3, 3.0 + 0.4))
    noise = (0.1**2, 0.1**2) if report is None else ON_PATH[1][:2]
    alone = np.array((0.05**2 + noise[0], 0.0, 0.05**2 + noise[1]))
    assert found.cov == pytest.approx(alone + 0.02**2 * np.array((9.0, -12.0, 16.0)))
    unknown = msgspec.structs.replace(vehicle, velocity_ned=None)
    assert state.in_report(1, unknown) is None
    assert state.in_report(2, vehicle) is None


def test_neither_is_taken_where_more_is_known_without_the_fix():
    fix, known = fixes_with({})[0], known_parameters(*parameters({}), EXACT)
    assert by_fix(fix, known, a_place(0.03), 1e-6, report=ON_PATH) is None


@pytest.mark.parametrize("delay_s", [0.058, -0.058])
def test_a_delay_of_a_third_of_a_beat_is_taken_out_by_the_attitude_at_the_capture(delay_s):
    """No sensitivity at the stamp gives the ray then: 5 degrees at 7 Hz are metres from 10 m. Attitudes have stamps of
    whole milliseconds, in which the ray turns by 0.2 degrees."""
    biases = {Bias.TIME_OFFSET: delay_s, Bias.MOUNT_Y: 0.02, Bias.HEIGHT: 0.3, Bias.HEADING: 0.03}
    world = a_world(biases, shape="hover", attitude_hz=200.0, flapping_deg=5.0, flapping_hz=7.0)
    fixes, known = [fix for view in world.frames() for fix in view.fixes][5:-5], parameters(biases)
    known = known_parameters(*known, EXACT)
    assert len(fixes) > 20
    assert max(off_m(linearly(known, fix)) for fix in fixes) > 1.0
    assert max(off_m(alone(known, fix, world.state_at)) for fix in fixes) < 0.1


def test_the_fix_alone_is_not_taken_where_the_vehicle_at_its_capture_is_not_known():
    fix, known = fixes_with({})[0], known_parameters(*parameters({}), EXACT)
    unknown = {"state_at": lambda _: Unpaired(Reason.STALE_ATTITUDE)}
    assert by_fix(fix, known, a_place(1.0), 9.0, report=ON_PATH, **unknown).cov[0] == pytest.approx(1.0, rel=0.01)
    assert by_fix(fix, known, a_place(1.0), 9.0, report=ON_PATH).cov[0] < 0.5
    assert by_fix(fix, known, a_place(1.0), 9.0, **unknown) is None
    quick = by_fix(fix, known, a_place(1.0), 9.0, report=ON_PATH, wanders_quickly=True, **unknown)
    assert quick == a_place(1.0).along_path(fix.sighting.state, ON_PATH)


def test_a_sight_relative_to_the_vehicle_has_the_noise_of_its_own_report_alone():
    """The report at the capture has other noise than that at the stamp; the target is relative to the latter."""
    late = {Bias.TIME_OFFSET: 0.05}
    world, known = a_world(late, shape="hover"), known_parameters(*parameters(late), EXACT)
    fix = world.frames()[10].fixes[0]

    def noisy(boot_ns):
        state = world.state_at(boot_ns)
        return msgspec.structs.replace(state, position_ned=add(state.position_ned, (0.3, -0.2, 0.1)))

    exact, with_noise = (alone(known, fix, each) for each in (world.state_at, noisy))
    assert (with_noise.north, with_noise.east) == pytest.approx((exact.north, exact.east), abs=1e-9)


def alone(known, fix, state_at):
    """The fix by the attitude at its capture."""
    return FrameFixes([fix], state_at).alone(fix, known, None, inf)


def off_m(found):
    return np.hypot(*np.subtract((found.north, found.east), TARGET))
