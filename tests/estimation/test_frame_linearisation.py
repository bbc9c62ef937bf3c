"""Derivatives of the live filter before its first solve, when the delay of the camera may be a third of a wing beat."""

import numpy as np
import pytest

from fwav_companion.estimation.errors import CAMERA_DELAY, SampleNoise, priors
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.frame_linearisation import linearise
from fwav_companion.estimation.kept_sightings import frame_of
from fwav_companion.estimation.measurement import project

BEAT_HZ, ROLL_RAD, HEIGHT_M = 5.0, np.radians(5.0), 10.0
TELEMETRY_AHEAD_S = 0.012
POINT, FIRST = np.zeros((3, 1)), np.zeros(1, np.int64)


def beating(seconds):
    """Attitudes at 100 Hz of a hover that rolls with the wing beat; positions at 10 Hz."""
    for t in np.arange(0.0, seconds, 0.01).tolist():
        half = 0.5 * ROLL_RAD * np.sin(2.0 * np.pi * BEAT_HZ * t)
        yield t, (np.cos(half), np.sin(half), 0.0, 0.0)


def fed(estimator, samples):
    for t, attitude in samples:
        estimator.add_attitude(t, attitude)
        if round(t * 100.0) % 10 == 0:
            estimator.add_position(t, np.array([0.0, 0.0, HEIGHT_M]), np.zeros(3))


def frame(t):
    down = np.array([[0.0], [0.0], [1.0]])
    tangents = np.array([[[1.0], [0.0], [0.0]], [[0.0], [1.0], [0.0]]]) / 0.002
    return frame_of(round(t * 30.0), np.array([t]), down, tangents)


@pytest.mark.parametrize("delay_s", [-0.03, 0.01, 0.03])
def test_displacements_by_any_delay_of_a_beat_are_of_two_constant_unknowns(delay_s):
    """A frame has the attitudes of the 12 ms after its capture, and none of the beat's next third."""
    known, later = (Estimator(priors(), SampleNoise()) for _ in range(2))
    fed(later, beating(2.0))
    later.begin(1.9)
    rows, displacements, samples = [], [], list(beating(2.0))
    for t in np.arange(0.5, 1.5, 1.0 / 30.0).tolist():
        fed(known, [sample for sample in samples if sample[0] <= t + TELEMETRY_AHEAD_S])
        samples = [sample for sample in samples if sample[0] > t + TELEMETRY_AHEAD_S]
        known.begin(t)
        live, s = known.live, frame(t)
        found, h = linearise(live, s, FIRST, POINT)
        there = project(later.live.poses.of(s, FIRST, delay_s), s.rays, s.tangents, live.mean[: live.size], POINT,
                        np.zeros((3, 1)), s.row)  # fmt: skip
        displacements.append((found.residual - there.residual - delay_s * found.shared[:, CAMERA_DELAY])[1, 0])
        rows.append(h[1, live.error - 2 : live.error, 0])
    rows, displacements = np.array(rows), np.array(displacements)
    unknowns, *_ = np.linalg.lstsq(rows, displacements, rcond=None)
    assert np.abs(unknowns).max() < 2.0  # of a variance of one
    left = displacements - rows @ unknowns
    assert np.sqrt((left**2).mean()) < 0.15 * np.sqrt((displacements**2).mean())
