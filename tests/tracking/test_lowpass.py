"""The low-pass against its recursion worked by hand, and its covariance against many draws."""

import numpy as np
import pytest
from handmade import a_fix, a_view
from simulated_flight import priors

from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.types import BIAS_COUNT

NO_BIAS = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0, height_noise_m=0.0)


def positions(options, samples, times=None):
    tracker = make_tracker(options, NO_BIAS)
    times = [k / 30 for k in range(len(samples))] if times is None else times
    out = []
    for t, (north, east) in zip(times, samples, strict=True):
        (track,) = tracker.on_frame(a_view(t, a_fix(t, (north, east, 0.0))))
        out.append(track.position_ned[:2])
    return out


def test_the_papers_recursion_is_one_sample_late_and_starts_at_its_first():
    options = TrackingOptions(filter="lowpass", alpha=0.125, alpha_rate_hz=0.0)
    north = [n for n, _ in positions(options, [(4.0, 3.0), (4.8, 3.0), (4.0, 3.0), (3.2, 3.0)])]
    # u0 = x0; u1 = x0/8 + 7 u0/8; u2 = x1/8 + 7 u1/8; u3 = x2/8 + 7 u2/8
    assert north == pytest.approx([4.0, 4.0, 4.1, 4.0875], abs=1e-14)


def test_the_papers_recursion_steps_once_a_frame_whatever_the_time_between():
    options = TrackingOptions(filter="lowpass", alpha=0.125, alpha_rate_hz=0.0)
    samples = [(4.0, 3.0), (4.8, 3.0), (4.0, 3.0), (3.2, 3.0)]
    assert positions(options, samples, [0.0, 0.2, 0.3, 0.9]) == positions(options, samples)


def test_the_time_aware_form():
    options = TrackingOptions(filter="lowpass", alpha=0.125, alpha_rate_hz=30.0)
    # After 2/30 s the share is 1 - (7/8)^2 = 15/64.
    north = [n for n, _ in positions(options, [(4.0, 3.0), (4.8, 3.0), (4.0, 3.0)], [0.0, 1 / 30, 3 / 30])]
    assert north[0] == 4.0
    assert north[1] == pytest.approx(4.1, abs=1e-6)  # stamps are whole microseconds
    assert north[2] == pytest.approx(4.1 - 0.1 * 15 / 64, abs=1e-6)


def test_two_half_steps_forget_as_much_as_one():
    options = TrackingOptions(filter="lowpass", alpha=0.3, alpha_rate_hz=10.0)
    fine = positions(options, [(0.0, 0.0)] + [(1.0, 0.0)] * 4, [0.0, 0.05, 0.1, 0.15, 0.2])
    coarse = positions(options, [(0.0, 0.0)] + [(1.0, 0.0)] * 2, [0.0, 0.1, 0.2])
    assert fine[-1][0] == pytest.approx(coarse[-1][0], abs=1e-12)
    assert coarse[-1][0] == pytest.approx(1 - 0.7**2, abs=1e-12)


def test_white_noise_shrinks_by_alpha_over_two_minus_alpha():
    options = TrackingOptions(filter="lowpass", alpha=0.125, alpha_rate_hz=0.0)
    tracker = make_tracker(options, NO_BIAS)
    for k in range(200):
        (track,) = tracker.on_frame(a_view(k / 30, a_fix(k / 30, (4.0, 3.0, 0.0))))
    assert track.cov[0][0] == pytest.approx(0.04 / 15, rel=1e-6)


def test_a_standing_bias_is_left_alone():
    p = priors(time_offset=0, heading=0, mount_x=0, mount_y=0.02, mount_z=0)
    jacobian = np.zeros((3, BIAS_COUNT))
    jacobian[0, 4] = 12.0
    tracker = make_tracker(TrackingOptions(filter="lowpass"), p)
    for k in range(300):
        fix = a_fix(k / 30, (4.0, 3.0, 0.0), jacobian=jacobian, sigmas=p.bias_sigmas)
        (track,) = tracker.on_frame(a_view(k / 30, fix))
    assert track.cov[0][0] == pytest.approx(0.24**2 + 0.04 / 15, rel=1e-3)
