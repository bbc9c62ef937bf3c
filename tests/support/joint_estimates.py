"""Joint estimates of self-calibration whose errors are correlated, and the fixes of a hover."""

import msgspec
import numpy as np
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.self_calibration.delayed_poses import delayed_poses
from fwav_companion.self_calibration.joint_filter import joint_filter
from fwav_companion.self_calibration.measurement_batch import measurement_batch
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT

SHARED = np.array([[0.003, 0.01, -0.02, 0.015, 0.02, 0.2, 0.0, 0.02, 0.01, -0.02, 0.03]])
SIGMAS = np.array((0.004, 0.01, 0.008, 0.02, 0.03, 0.2, 0.0, 0.05, 0.03, 0.03, 0.03))
ELSEWHERE = np.zeros((1, SHARED_COUNT))
"""The linearization point of the estimate: no gate may depend on it."""
TRACKS = (3, 5, 8)
PRIORS = priors(position_north=0.5, position_east=0.5)
FIRST = SHARED_COUNT + 4
"""Index of the first target: position errors north and east with their rates come before."""
POSITION = np.array([0.1, -0.15, 0.0, 0.0])


def a_hover():
    return World(Flight(seconds=6, shape="hover", height_m=10.0, targets=((4.0, 3.0),), pixel_px=0.5))


def some_fixes(world):
    return [fix for view in world.frames() for fix in view.fixes][::20]


def batch_of(fixes, world, delays_s):
    poses = delayed_poses([fix.sighting.state for _, fix in fixes], delays_s, world.state_at)
    return measurement_batch(fixes, poses, (0.0,) * len(fixes))


def joint_with(places, rng, hypotheses=1):
    """A joint estimate of targets whose errors are correlated with one another and with the shared parameters."""
    size = FIRST + places.size
    scale = np.diag([*SIGMAS, 0.5, 0.5, 0.02, 0.02, *[0.3] * places.size])
    root = scale @ (np.eye(size) + 0.3 * rng.normal(size=(size, size)))
    joint = joint_filter(PRIORS, SIGMAS, np.tile(SHARED, (hypotheses, 1)), np.tile(ELSEWHERE, (hypotheses, 1)))
    mean = np.tile(np.concatenate((SHARED[0], POSITION, places.ravel())), (hypotheses, 1))
    return msgspec.structs.replace(
        joint,
        mean=mean + 1e-3 * SIGMAS.min() * np.arange(hypotheses)[:, None],
        cov=np.tile(root @ root.T, (hypotheses, 1, 1)),
        linearization_point=np.tile(np.append(ELSEWHERE[0], places.ravel() + 0.05), (hypotheses, 1)),
        tracks=TRACKS,
        shows_height=True,
    )
