"""Interpolations are tried out often at first, then ten times a second, at every phase of a motion."""

from math import cos, pi, sin

import pytest

from fwav_companion.geometry.stamps import NS_PER_S, BootNs
from fwav_companion.telemetry.attitude.history import AttitudeHistory
from fwav_companion.types import AttitudeSample

HZ = 100
AMPLITUDE = 0.05


def flapping(beat_hz: float, seconds: float) -> list[AttitudeSample]:
    """Roll as a sine, with its rate."""
    samples = []
    for k in range(round(seconds * HZ)):
        phase = 2.0 * pi * beat_hz * k / HZ
        roll, rate = AMPLITUDE * sin(phase), AMPLITUDE * 2.0 * pi * beat_hz * cos(phase)
        boot_ns = BootNs(k * NS_PER_S // HZ)
        samples.append(AttitudeSample(boot_ns, (cos(roll / 2.0), sin(roll / 2.0), 0.0, 0.0), (rate, 0.0, 0.0)))
    return samples


def tried_at(beat_hz: float, seconds: float) -> list[int]:
    """Indices of the samples with which a trial came."""
    history, indices = AttitudeHistory(), []
    for index, sample in enumerate(flapping(beat_hz, seconds)):
        before = history.quality.trials
        history.insert(sample)
        if history.quality.trials > before:
            indices.append(index)
    return indices


def test_fifty_a_second_for_two_seconds_then_ten():
    indices = tried_at(5.0, 30.0)
    first = [index for index in indices if index < 2 * HZ]
    later = [index for index in indices if index >= 10 * HZ]
    assert 90 <= len(first) <= 100
    assert 180 <= len(later) <= 220


@pytest.mark.parametrize("beat_hz", [5.0, 9.09, 10.0, 20.0])
def test_every_phase_of_a_motion_is_seen(beat_hz: float):
    """By fifths of a beat: none has more than twice its share of the trials."""
    bins = min(5, round(HZ / beat_hz))
    later = [index for index in tried_at(beat_hz, 30.0) if index >= 10 * HZ]
    phases = [int((index * beat_hz / HZ % 1.0 + 1e-6) * bins) % bins for index in later]
    shares = [phases.count(phase) / len(phases) for phase in range(bins)]
    assert min(shares) > 0.3 / bins
    assert max(shares) < 2.0 / bins


@pytest.mark.parametrize("beat_hz", [3.0, 10.0])
def test_a_motion_that_begins_later_is_followed(beat_hz: float):
    """Ten seconds of rest, then a beat: its frequency is known three memories (6 s) later."""
    history = AttitudeHistory()
    rest = flapping(beat_hz, 0.01)[0]
    for k in range(10 * HZ):
        history.insert(AttitudeSample(BootNs(k * NS_PER_S // HZ), rest.ned_from_body, (0.0, 0.0, 0.0)))
    for sample in flapping(beat_hz, 6.0):
        history.insert(AttitudeSample(BootNs(sample.boot_ns + 10 * NS_PER_S), sample.ned_from_body, sample.rates))
    assert history.quality.motion.frequency / (2.0 * pi) == pytest.approx(beat_hz, rel=0.05)
