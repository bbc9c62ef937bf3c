"""A pass over frames: what circles do not separate stays at its priors, and the point of a target that joins later."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from simulated_flight import priors

from fwav_companion.self_calibration import SharedParameter
from fwav_companion.self_calibration.calibration_context import CalibrationContext
from fwav_companion.self_calibration.delayed_poses import DelayedPoses
from fwav_companion.self_calibration.measurement_batch import MeasurementBatch
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT

HEIGHT_M, RADIUS_M, SPEED_M_S, STEP_S, FOCAL = 14.0, 3.0, 2.0, 0.2, 600.0
TARGETS = np.array([[4.0, 0.0], [-2.0, 3.5], [-2.0, -3.5]])
TURN = SPEED_M_S / RADIUS_M
HEADING, DELAY_S = np.radians(2.0), 0.05
PRIORS = priors(
    heading=HEADING, mount_z=0.0, position_delay=DELAY_S, position_north=1.0, position_east=1.0, height=0.5,
    pixel_noise_px=1.5, position_noise_m=0.1, height_noise_m=0.3, time_offset=0.01,
)  # fmt: skip
CONTEXT = CalibrationContext(PRIORS, None)


def frame(k, wander, tracks, rng):
    """All targets from a nose-first circle, in pixels with noise; the reported position is off by ``wander``."""
    turned = TURN * STEP_S * k
    ahead = np.array([-np.sin(turned), np.cos(turned), 0.0])
    camera = RADIUS_M * np.array([np.cos(turned), np.sin(turned), 0.0])
    body = Rotation.from_euler("ZYX", [turned + np.pi / 2.0, *np.radians(2.0) * np.sin([0.9 * k, 1.3 * k])])
    count = len(tracks)
    seen = body.inv().apply(np.array([[*TARGETS[track], HEIGHT_M] for track in tracks]) - camera)
    seen[:, :2] += seen[:, 2:] * rng.normal(0.0, PRIORS.pixel_noise_px / FOCAL, (count, 2))
    rays = seen / np.linalg.norm(seen, axis=1)[:, None]
    dual = np.zeros((count, 2, 3))
    dual[:, 0, 0] = dual[:, 1, 1] = FOCAL
    dual -= (dual @ rays[:, :, None]) * rays[:, None, :]

    def of_each(a):
        return np.tile(a, (count, 1, *[1] * np.ndim(a)))

    rates = np.array([0.0, 0.0, TURN])
    at = camera + np.array([*wander, 0.0])
    poses = DelayedPoses(
        np.zeros((count, 1)), of_each(body.as_matrix()), of_each(rates), of_each(0.0 * rates), of_each(at),
        of_each(SPEED_M_S * ahead),
    )  # fmt: skip
    return MeasurementBatch(
        tracks=tracks,
        host_ns=round(1e9 * (1.0 + STEP_S * k)),
        frames=1,
        ray=rays,
        dual=dual,
        pixel_sigma=np.full((count, 2), PRIORS.pixel_noise_px),
        lever=np.zeros((count, 3)),
        attitude_sigma=np.zeros(count),
        attitude_spacing_s=np.full(count, 0.02),
        time_noise_s=np.full(count, 0.001),
        row_fraction=np.zeros(count),
        drop_m=np.full(count, HEIGHT_M),
        camera_down=np.zeros(count),
        since_s=np.full(count, STEP_S),
        frame=np.full(count, k),
        ranged=np.zeros(count, bool),
        sample=np.zeros(count, int),
        poses=poses,
    )


def flown(seed, tracks_of, frames=300, sigma_m=1.0):
    """The frames of a flight whose reported position wanders, as a first-order process of 60 s."""
    rng, wander, found = np.random.default_rng(seed), np.zeros(2), []
    for k in range(frames):
        wander = wander * (1.0 - STEP_S / 60.0) + sigma_m * rng.normal(0.0, np.sqrt(2.0 * STEP_S / 60.0), 2)
        found.append(frame(k, wander, tracks_of(k), rng))
    return found


def passed(batches, hints=None):
    state = CONTEXT.served_pass(np.zeros(SHARED_COUNT), hints)
    for batch in batches:
        state = state.fed(batch)
    return state


def test_circles_do_not_separate_the_heading_from_the_position_delay():
    """A heading turns what a delay along the circle turns: h = turn x delay, whatever the targets. So only priors do.

    With a point of each target that follows its own estimate the claim was 0.77 of this.
    """
    wide = TURN * DELAY_S
    alone = HEADING * wide / np.hypot(HEADING, wide)
    state = passed(flown(3, lambda _: (0, 1, 2)))
    claimed = np.sqrt(state.joint.cov[0, SharedParameter.HEADING, SharedParameter.HEADING])
    assert 0.85 * alone < claimed <= alone


def test_a_target_that_joins_lies_as_far_from_the_others_as_it_is_known_to():
    """Its known place is that of another instant: the vehicle's position error has moved since, for all of them."""
    hints = {track: np.tile(place + np.array([0.2, -0.1]), (2, 1)) for track, place in enumerate(TARGETS)}
    batches = flown(5, lambda k: (0, 1) if k < 40 else (0, 1, 2), 60, 0.1)
    state = passed([batch for batch in batches if 2 not in batch.tracks], hints)
    for batch in batches[40:]:
        state = state.fed(batch)
        if 2 in state.joint.tracks:
            break
    points = state.joint.linearization_point[:, SHARED_COUNT:].reshape(2, 3, 2)
    assert points - points[:, :1] == pytest.approx(np.tile(TARGETS - TARGETS[0], (2, 1, 1)), abs=1e-9)
    assert np.hypot(*(points[0, 2] - hints[2][0])) > 0.1


def test_the_height_is_estimated_once_the_path_is_long_enough_and_three_targets_are_known():
    """Circles of 3 m at 14 m: a second of them is a hover; half a circle is more than four sigma of the position."""
    batches = flown(3, lambda _: (0, 1, 2))
    hover, half = passed(batches[:5] * 4), passed(batches[:25])
    assert len(hover.joint.tracks) == len(half.joint.tracks) == 3
    assert hover.joint.considers_height
    assert hover.joint.cov[0, SharedParameter.HEIGHT, SharedParameter.HEIGHT] == pytest.approx(0.5**2)
    assert not half.joint.considers_height
    assert passed([batch.take([0, 1]) for batch in batches[:25]]).joint.considers_height
