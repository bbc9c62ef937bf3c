"""Samples that the history keeps, takes in any order, and refuses by name."""

import random
from itertools import pairwise
from math import pi, radians, sin

import flapping
import numpy as np
import pytest

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.telemetry.attitude.history import KEPT_NS, MOST_KEPT, AttitudeHistory
from fwav_companion.types import AttitudeSample, Reason, Unpaired

MS = 1_000_000
LEVEL = (1.0, 0.0, 0.0, 0.0)
STILL = (0.0, 0.0, 0.0)


def level(*boot_ms: float) -> AttitudeHistory:
    return flapping.history_of([AttitudeSample(BootNs(round(ms * MS)), LEVEL, STILL) for ms in boot_ms])


def reason(history: AttitudeHistory, boot_ms: float) -> Reason:
    at = history.at(BootNs(round(boot_ms * MS)))
    assert isinstance(at, Unpaired), at
    return at.reason


def test_reasons():
    assert reason(AttitudeHistory(), 0) is Reason.NO_ATTITUDE
    history = level(1000, 1010, 1020, 1600, 1610)
    assert reason(history, 999) is Reason.BEFORE_HISTORY
    assert reason(history, 1300) is Reason.ATTITUDE_GAP
    assert reason(history, 1641) is Reason.STALE_ATTITUDE
    assert history.at(BootNs(1300 * MS)).gap_s == pytest.approx(0.28)


@pytest.mark.parametrize(("spacing_ms", "gap"), [(240, False), (286, True)])
def test_a_lost_sample_of_a_radio_is_a_gap_beyond_half_a_second(spacing_ms, gap):
    """Twice the spacing of a slow stream is no hole of it; the vehicle does not move, yet 0.57 s do not show that."""
    history = level(*(1000 + spacing_ms * k for k in range(20) if k != 10))
    at = history.at(BootNs((1000 + 10 * spacing_ms) * MS))
    assert isinstance(at, Unpaired) is gap
    assert not gap or at.reason is Reason.ATTITUDE_GAP


def test_a_hole_that_the_motion_does_not_bear_is_a_gap():
    motion = flapping.nodding(5.0, 15.0)
    samples = [s for s in flapping.stream(motion, 100, 4.0) if not 3.5e9 < s.boot_ns < 3.72e9]
    history = flapping.history_of(samples)
    assert isinstance(history.at(BootNs(3_300_000_000)), object)
    assert reason(history, 3600) is Reason.ATTITUDE_GAP


def test_a_lost_sample_is_bridged_and_reported():
    motion = flapping.nodding(5.0)
    samples = [s for s in flapping.stream(motion, 50, 4.0) if s.boot_ns != 3_500_000_000]
    history = flapping.history_of(samples)
    whole, across = history.at(BootNs(3_300_000_000 + 3 * MS)), history.at(BootNs(3_500_000_000))
    assert across.sigma > 5.0 * whole.sigma
    assert abs(flapping.angle_error(motion, 3_500_000_000, across.ned_from_body)[1]) < 3.0 * across.sigma


def test_the_course_bends_as_the_motion_does():
    """Pitch alone, 5 degrees at 14 Hz: 680 rad/s^2 at the ends of a swing."""
    hz, turn = 14.0, 2.0 * pi * 14.0
    history = flapping.history_of(flapping.stream(flapping.nodding(hz), 100, 2.5))
    found = [history.at(BootNs(k * 3 * MS)) for k in range(350, 800)]
    expected = [-radians(5.0) * turn**2 * sin(turn * k * 0.003 + 0.3) for k in range(350, 800)]
    off = [at.angular_acceleration[1] - bend for at, bend in zip(found, expected, strict=True)]
    assert flapping.rms(np.array(off)) < 0.15 * flapping.rms(np.array(expected))
    assert max(abs(at.angular_acceleration[0]) + abs(at.angular_acceleration[2]) for at in found) < 1.0
    assert found[-1].frequency == pytest.approx(turn, rel=0.15)


def test_any_order_gives_the_same_course():
    samples = flapping.stream(flapping.nodding(3.0), 100, 2.5)
    shuffled = samples[:]
    rng = random.Random(3)
    for k in range(0, len(shuffled) - 6, 3):
        shuffled[k : k + 6] = rng.sample(shuffled[k : k + 6], 6)
    one, other = flapping.history_of(samples), AttitudeHistory()
    for k, sample in enumerate(shuffled):
        other.insert(sample)
        if k % 5 == 0 and k > 20:
            other.at(BootNs(sample.boot_ns - 30 * MS))  # a cached interpolation must not stay when a sample arrives
    for boot_ns in range(600 * MS, 2300 * MS, 7 * MS):
        assert other.at(BootNs(boot_ns)).ned_from_body == one.at(BootNs(boot_ns)).ned_from_body


def test_duplicates_are_refused():
    history = level(1000, 1010)
    assert not history.insert(AttitudeSample(BootNs(1010 * MS), (0.0, 1.0, 0.0, 0.0), STILL))
    assert len(history) == 2
    assert history.at(BootNs(1010 * MS)).ned_from_body == LEVEL


def test_it_keeps_three_seconds_and_no_more():
    history = level(*range(0, 10_000, 10))
    assert len(history) == KEPT_NS // (10 * MS) + 1
    assert reason(history, 6000) is Reason.BEFORE_HISTORY
    assert not history.insert(AttitudeSample(BootNs(100 * MS), LEVEL, STILL))


def test_a_flood_is_cut():
    history = level(*(k * 0.1 for k in range(3 * MOST_KEPT)))
    assert len(history) == MOST_KEPT


def test_ready_means_that_more_samples_change_nothing():
    samples = flapping.stream(flapping.nodding(5.0), 50, 4.0)
    history = flapping.history_of(samples[:150])
    asked = [BootNs(k * MS) for k in range(2700, 3000, 3)]
    early = {t: history.at(t) for t in asked if history.ready_for(t)}
    assert len(early) > 60
    assert len(early) < len(asked)
    for sample in samples[150:]:
        history.insert(sample)
    for t, at in early.items():
        assert history.at(t).ned_from_body == pytest.approx(at.ned_from_body, abs=1e-7)


def test_moving_all_stamps_moves_the_course():
    samples = flapping.stream(flapping.flying(5.0), 100, 2.0)
    history = flapping.history_of(samples)
    before = history.at(BootNs(1_503 * MS))
    history.shift(-7 * MS)
    assert history.at(BootNs(1_496 * MS)).ned_from_body == pytest.approx(before.ned_from_body, abs=1e-14)


def test_a_hovering_body_claims_little_whatever_the_noise():
    rng = random.Random(5)
    samples = [
        AttitudeSample(BootNs(k * 10 * MS), (1.0, *(rng.gauss(0.0, 1e-3) for _ in range(3))), STILL) for k in range(300)
    ]
    assert flapping.history_of(samples).at(BootNs(2_505 * MS)).sigma < 4e-3


@pytest.mark.parametrize("hz", [10, 15, 25, 100])
def test_the_first_attitudes_claim_what_their_own_rates_contradict(hz):
    """Before the stream is checked: seven samples of a 5 Hz wing beat, few of which show it."""
    motion = flapping.nodding(5.0)
    samples = flapping.stream(motion, hz, 1.0, filter_hz=None)[:6]
    history = flapping.history_of(samples)
    instants = [(a.boot_ns + b.boot_ns) // 2 for a, b in pairwise(samples)]
    at = [history.at(BootNs(instant)) for instant in instants]
    errors = [flapping.angle_error(motion, t, a.ned_from_body)[1] for t, a in zip(instants, at, strict=True)]
    assert flapping.rms(errors) < 1.5 * flapping.rms([a.sigma for a in at])


@pytest.mark.parametrize("hz", [10, 15, 25, 50])
def test_beyond_the_newest_attitude_a_slow_stream_claims_more_or_refuses(hz):
    motion = flapping.nodding(5.0)
    samples = flapping.stream(motion, hz, 8.0)
    ratios = []
    for newest in range(5 * hz, len(samples), max(1, hz // 10)):
        history = flapping.history_of(samples[newest - 4 * hz : newest])
        asked_ns = BootNs(samples[newest - 1].boot_ns + 15 * MS)
        at = history.at(asked_ns)
        if isinstance(at, Unpaired):
            assert at.reason is Reason.ATTITUDE_GAP
            assert hz < 20
        else:
            ratios.append(flapping.angle_error(motion, asked_ns, at.ned_from_body)[1] / at.sigma)
    assert not ratios or flapping.rms(ratios) < 1.3
