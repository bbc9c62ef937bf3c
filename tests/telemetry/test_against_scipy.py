"""The attitude between samples, against closed-form motions through scipy's Rotation and its own interpolations."""

from math import pi, radians

import flapping
import msgspec
import numpy as np
import pytest
from draws import first_of, first_rows_of
from flapping import errors_and_claims, flying, nodding, rms
from scipy.spatial.transform import Rotation, RotationSpline, Slerp

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.telemetry.attitude.quality import Method
from fwav_companion.types import AttitudeSample, Unpaired

HEIGHT_M = 10.0


MOST_MM = {100: 0.5, 50: 3.0, 25: 20.0}


@pytest.mark.parametrize(
    "hz_and_readout", first_of((50, 0.03), (25, 0.0), (100, 0.0), (100, 0.03), (50, 0.0), (25, 0.03), few=2)
)
def test_five_degrees_at_five_hertz(hz_and_readout):
    hz, readout_s = hz_and_readout
    motion = nodding(5.0)
    errors, _ = errors_and_claims(motion, flapping.stream(motion, hz, 8.0), from_s=2.0, readout_s=readout_s)
    assert len(errors) > 400
    assert HEIGHT_M * 1e3 * rms(errors[:, 1]) < MOST_MM[hz]
    assert HEIGHT_M * 1e3 * rms(errors[:, 0]) < 0.01


@pytest.mark.parametrize(
    ("motion", "hz", "most_mm"),
    first_rows_of(
        *((flying(8.0, 15.0), 100, 8.0), (flying(5.0), 50, 4.0), (flying(5.0), 100, 0.7), (nodding(12.0), 100, 2.0)),
        few=2,
    ),
)
def test_other_flights_and_what_is_claimed_of_them(motion, hz, most_mm):
    errors, claims = errors_and_claims(motion, flapping.stream(motion, hz, 8.0), from_s=2.0)
    worst_axis = max(rms(errors[:, k]) for k in range(3))
    assert HEIGHT_M * 1e3 * worst_axis < most_mm
    assert 0.5 * worst_axis < rms(claims) < 4.0 * worst_axis


def test_the_lag_of_filtered_rates_is_found():
    """Two poles at 20 Hz, at 5 Hz: the phase atan(2 zeta r / (1 - r^2)), r = 1/4, is 11.5 ms."""
    motion = nodding(5.0)
    samples = flapping.stream(motion, 50, 8.0)
    history = flapping.history_of(samples)
    gain, lag_s = history.quality.rates.model.response(2.0 * pi * 5.0)
    assert history.quality.rates.usable
    assert lag_s == pytest.approx(0.0115, abs=0.001)
    assert gain == pytest.approx(1.0, abs=0.02)


def test_unfiltered_rates_show_no_lag():
    history = flapping.history_of(flapping.stream(nodding(5.0), 50, 6.0, filter_hz=None))
    gain, lag_s = history.quality.rates.model.response(2.0 * pi * 5.0)
    assert (gain, lag_s) == (pytest.approx(1.0, abs=0.01), pytest.approx(0.0, abs=5e-4))


@pytest.mark.parametrize(
    ("hz", "of_motion", "method"), [(100, 5.0, Method.FOUR), (50, 5.0, Method.SIX), (25, 5.0, Method.RATES)]
)
def test_the_method_follows_from_what_the_stream_shows(hz, of_motion, method):
    assert flapping.history_of(flapping.stream(nodding(of_motion), hz, 6.0)).quality.method is method


@pytest.mark.parametrize(("hz", "of_motion"), first_rows_of((25, 12.0), (10, 4.3), (10, 5.0), (25, 15.0), few=2))
def test_a_stream_too_slow_for_the_motion_says_so(hz, of_motion):
    motion = nodding(of_motion)
    samples = flapping.stream(motion, hz, 10.0)
    assert flapping.history_of(samples).quality.too_slow
    errors, claims = errors_and_claims(motion, samples, from_s=4.0)
    assert rms(errors[:, 1]) > 0.02
    assert 0.4 * rms(errors[:, 1]) < rms(claims)


@pytest.mark.parametrize("phase", first_of(*np.pi / 6.0 * np.array([0, 3, 1, 2, 4, 5, 6]), few=2))
@pytest.mark.parametrize("beat_hz", first_of(4.8, 5.0, 5.2))
def test_two_attitudes_a_beat_leave_open_when_it_beats(beat_hz, phase):
    """For any sampling instants: the amplitude and phase of a wave that is sampled twice a period cannot be separated,
    whether attitudes or rates alternate, and a simultaneous turn does not hide this.
    """
    motion = flying(beat_hz)
    samples = flapping.stream(lambda t: motion(t + phase / (2.0 * np.pi * beat_hz)), 10, 10.0)
    quality = flapping.history_of(samples).quality
    assert quality.too_slow
    assert quality.instant_sigma_s == pytest.approx(0.1 / np.sqrt(12.0), rel=0.01)
    assert quality.motion.frequency == pytest.approx(2.0 * np.pi * beat_hz, rel=0.05)
    assert quality.motion.swing == pytest.approx(np.radians(5.0) / np.sqrt(2.0), rel=0.3)


@pytest.mark.parametrize("motion", [nodding, flying])
@pytest.mark.parametrize("seed", first_of(0, 1))
def test_motion_that_looks_slower_backwards_is_too_fast_however_stamps_scatter(seed, motion):
    """15 Hz by 25 samples a second look like 10 Hz; a lag of a third of that beat fits them."""
    rng = np.random.default_rng(seed)
    samples = flapping.stream(motion(15.0), 25, 10.0, late_ns=lambda: int(rng.integers(2_500_000)))
    assert flapping.history_of(samples).quality.too_slow


def test_attitudes_at_the_turning_points_alone_show_it_without_any_rate():
    motion = nodding(5.0)
    samples = flapping.stream(lambda t: motion(t + (np.pi / 2.0 - 0.3) / (10.0 * np.pi)), 10, 10.0, filter_hz=None)
    assert max(np.linalg.norm(sample.rates) for sample in samples[20:]) < 0.01
    assert flapping.history_of(samples).quality.instant_sigma_s == pytest.approx(0.1 / np.sqrt(12.0), rel=0.01)


def test_a_still_vehicle_shows_no_motion_whose_ekf_aligns_its_yaw():
    """The attitude steps by 30 deg in 10 ms, and the gyros send noise of 0.1 deg/s: no rate shows the step."""
    rng = np.random.default_rng(1)
    stepping = flapping.stream(lambda t: (0.0, 0.0, radians(30.0) * (t > 3.0)), 100, 8.0)
    samples = [msgspec.structs.replace(each, rates=tuple(rng.normal(0.0, radians(0.1), 3))) for each in stepping]
    quality = flapping.history_of(samples).quality
    assert quality.too_slow, "the attitudes do step"
    assert (quality.status().too_slow_for_motion, quality.status().motion_hz) == (False, 0.0)


@pytest.mark.parametrize(("tremble_hz", "tremble_deg"), [(2.3, 0.25)])
def test_a_smooth_vehicle_by_a_radio_has_noisy_attitudes_and_no_doubt_of_their_instants(tremble_hz, tremble_deg):
    """3.3 attitudes a second follow the sway; the gyros show a tremble that they miss, of a quarter of a degree."""
    sway, tremble = nodding(0.3, 2.0), nodding(tremble_hz, tremble_deg)

    def motion(t):
        return (0.0, sway(t)[1] + tremble(t)[1], 0.0)

    samples = flapping.stream(motion, 3.3, 40.0)
    quality = flapping.history_of(samples).quality
    assert quality.too_slow
    assert quality.instant_sigma_s == 0.0
    errors, claims = errors_and_claims(motion, samples, from_s=20.0)
    assert 0.5 < rms(claims) / rms(errors[:, 1]) < 3.0


@pytest.mark.parametrize("hz", first_of(13, 50, 15, 25, 100, few=2))
def test_faster_attitudes_leave_nothing_open(hz):
    quality = flapping.history_of(flapping.stream(flying(5.0), hz, 8.0)).quality
    assert not quality.too_slow
    assert quality.instant_sigma_s == 0.0


def test_noise_is_no_beat():
    """Steps of noise undo half of one another, and bends of it two thirds."""
    rng = np.random.default_rng(1)
    turns = Rotation.from_rotvec(0.002 * rng.standard_normal((500, 3)))
    rates = 0.05 * rng.standard_normal((500, 3))
    samples = [AttitudeSample(BootNs(k * 20_000_000), _wxyz(turns[k]), tuple(rates[k].tolist())) for k in range(500)]
    history = flapping.history_of(samples)
    assert not history.quality.motion.alternates
    assert not history.quality.rates.alternates


def test_rates_of_the_course_are_its_derivative():
    motion = flying(5.0)
    history = flapping.history_of(flapping.stream(motion, 100, 4.0))
    for boot_ns in range(3_000_000_000, 3_500_000_000, 7_300_000):
        at = history.at(BootNs(boot_ns))
        before, after = (flapping.rotation(motion, boot_ns * 1e-9 + d) for d in (-1e-5, 1e-5))
        assert at.rates == pytest.approx(tuple((before.inv() * after).as_rotvec() / 2e-5), abs=0.05)


def test_at_the_samples_it_is_the_samples():
    samples = flapping.stream(flying(5.0), 50, 3.0)
    history = flapping.history_of(samples)
    for sample in samples[20:-5]:
        at = history.at(sample.boot_ns)
        assert at.ned_from_body == pytest.approx(sample.ned_from_body, abs=1e-12)
        assert at.gap_s == 0.0


def test_two_samples_are_a_slerp():
    q = Rotation.from_euler("ZYX", [[0.3, 0.6, 0.1], [0.32, 0.63, 0.08]])
    samples = [AttitudeSample(BootNs(k * 10_000_000), _wxyz(q[k]), (0.0, 0.0, 0.0)) for k in range(2)]
    history = flapping.history_of(samples)
    for share in (0.0, 0.2, 0.5, 0.9):
        expected = Slerp([0.0, 1.0], q)(share)
        got = history.at(BootNs(round(share * 10_000_000)))
        assert got.ned_from_body == pytest.approx(_wxyz(expected), abs=2e-6)


def test_it_follows_scipys_rotation_spline():
    """A global C2 spline through all the samples: another method, the same course to well under a millimetre."""
    samples = flapping.stream(flying(5.0), 100, 3.0)
    history = flapping.history_of(samples)
    spline = RotationSpline(
        [s.boot_ns * 1e-9 for s in samples],
        Rotation.from_quat([(*s.ned_from_body[1:], s.ned_from_body[0]) for s in samples]),
    )
    for boot_ns in range(1_003_000_000, 2_500_000_000, 11_700_000):
        x, y, z, w = history.at(BootNs(boot_ns)).ned_from_body[1:] + history.at(BootNs(boot_ns)).ned_from_body[:1]
        assert (spline(boot_ns * 1e-9).inv() * Rotation.from_quat([x, y, z, w])).magnitude() < 1e-4


def test_signs_of_quaternions_mean_nothing():
    samples = flapping.stream(flying(5.0), 100, 2.0)
    flipped = [
        AttitudeSample(s.boot_ns, tuple(-c for c in s.ned_from_body) if k % 3 else s.ned_from_body, s.rates)
        for k, s in enumerate(samples)
    ]
    one, other = flapping.history_of(samples), flapping.history_of(flipped)
    for boot_ns in range(500_000_000, 1_900_000_000, 13_000_000):
        a, b = one.at(BootNs(boot_ns)).ned_from_body, other.at(BootNs(boot_ns)).ned_from_body
        assert abs(np.dot(a, b)) == pytest.approx(1.0, abs=1e-13)


def test_extrapolation_is_bounded_and_its_uncertainty_grows():
    motion = nodding(5.0)
    history = flapping.history_of(flapping.stream(motion, 100, 3.0))
    end_ns = history.newest.boot_ns
    claimed = []
    for ahead_ms in (2, 8, 15, 30):
        at = history.at(BootNs(end_ns + ahead_ms * 1_000_000))
        error = np.linalg.norm(flapping.angle_error(motion, end_ns + ahead_ms * 1_000_000, at.ned_from_body))
        assert error < 3.0 * at.sigma
        claimed.append(at.sigma)
    assert claimed == sorted(claimed)
    assert isinstance(history.at(BootNs(end_ns + 31_000_000)), Unpaired)


def _wxyz(rotation: Rotation) -> tuple[float, float, float, float]:
    x, y, z, w = rotation.as_quat()
    return (w, x, y, z) if w >= 0 else (-w, -x, -y, -z)
