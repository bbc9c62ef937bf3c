"""Sights of landmarks from a wing that beats before a camera that is late, and the first sights of a hover."""

from functools import partial

import numpy as np
import pytest
from handmade import a_fix, a_state, a_view, boot_ns, matrix, vector
from msgspec.structs import replace
from scipy.spatial.transform import Rotation
from simulated_flight import priors

from fwav_companion.geometry.earth import Geodetic
from fwav_companion.tracking.landmarks.delayed_sighting import PoseHistory
from fwav_companion.tracking.landmarks.landmark_filter import LandmarkFilter
from fwav_companion.tracking.landmarks.state_vector import SharedErrors
from fwav_companion.types import Bias, Landmark, LandmarkSight, Reason, Unpaired

LATE_S, BEAT_HZ, BEAT_DEG = 0.02, 5.0, 5.0
ARM = np.array((0.2, -0.1, 0.05))
PLACE = np.array((3.0, -2.0, 0.0))
"""The landmark, NED, metres."""
SURVEY_M = 0.05
NOISE = np.diag((0.0036, 0.0036, 1e-4))


def body_at(t):
    """NED from body on a beating wing, 37 degrees nose up."""
    return Rotation.from_euler("ZYX", (20.0, 37.0 + BEAT_DEG * np.sin(2 * np.pi * BEAT_HZ * t), 3.0), degrees=True)


def vehicle_at(t):
    return np.array((-8.0 + 5.0 * t, 0.5 * t, -12.0))


def state_at(stamp_ns):
    """The vehicle's true state at an instant of the autopilot."""
    t = (stamp_ns - boot_ns(0.0)) * 1e-9
    step = (body_at(t - 1e-5).inv() * body_at(t + 1e-5)).as_rotvec() / 2e-5
    return a_state(stamp_ns, body_at(t).as_quat(), step, vehicle_at(t), (5.0, 0.5, 0.0), spacing_s=0.01)


def sighting_at(t, late_s=0.0, offset=(0.0, 0.0, 0.0)):
    """The landmark's sighting at nominal t, taken ``late_s`` earlier from ``offset`` off the reported position."""
    true, nominal = body_at(t - late_s), state_at(boot_ns(t))
    camera = vehicle_at(t - late_s) + true.apply(ARM) + offset
    ray = true.inv().apply(PLACE - camera)
    fix = a_fix(t, PLACE, noise=NOISE)
    return replace(
        fix.sighting,
        state=nominal,
        ray=replace(fix.sighting.ray, direction=vector(ray / np.linalg.norm(ray))),
        ned_from_camera=matrix(body_at(t).as_matrix()),
        camera_ned=vector(vehicle_at(t) + body_at(t).apply(ARM)),
    )


def test_a_late_sighting_has_the_pose_of_its_true_capture():
    nominal = sighting_at(1.013)
    delayed = PoseHistory(state_at).delayed(nominal, LATE_S)
    at = 1.013 - LATE_S
    assert delayed.late_s == LATE_S
    assert np.array(delayed.sighting.ned_from_camera) == pytest.approx(body_at(at).as_matrix(), abs=1e-9)
    assert delayed.sighting.camera_ned == pytest.approx(vehicle_at(at) + body_at(at).apply(ARM), abs=1e-6)


@pytest.mark.parametrize("history", [None, lambda _: Unpaired(Reason.NO_ATTITUDE)])
def test_without_a_pose_there_a_sighting_keeps_its_own(history):
    nominal = sighting_at(1.013)
    delayed = PoseHistory(history).delayed(nominal, LATE_S)
    assert delayed.late_s == 0.0
    assert (delayed.sighting.ned_from_camera, delayed.sighting.camera_ned) == (
        nominal.ned_from_camera,
        nominal.camera_ned,
    )


def after_sights(times, errors, late_s, offset):
    """The filter after sights of the landmark at these instants."""
    model = SharedErrors(errors, [Landmark("mark", Geodetic(0.0, 0.0, 0.0), SURVEY_M)])
    state = LandmarkFilter.start(model, state_at)
    for t in times:
        fix = replace(a_fix(t, PLACE, noise=NOISE), sighting=sighting_at(t, late_s, offset))
        sight = LandmarkSight(0, fix, PLACE[0], PLACE[1])
        state = state.predicted(replace(a_view(t), landmarks=(sight,))).seen([sight])
    return state


def test_the_delay_of_a_camera_on_a_beating_wing_is_found_and_turns_nothing_else():
    """By rates the beat's curvature, 0.5 degrees at 20 ms, would turn the heading by 1.6 and the mount by 1.3."""
    errors = priors(time_offset=0.01, height_noise_m=0.02)
    state = after_sights(0.03 * np.arange(1, 60), errors, LATE_S, (0.0, 0.0, 0.0))
    value = partial(state.model.value, state.mean)
    assert value(Bias.TIME_OFFSET) == pytest.approx(LATE_S, abs=0.0015)
    for bias in (Bias.HEADING, Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z):
        assert np.degrees(value(bias)) == pytest.approx(0.0, abs=0.5)
    assert state.records[0].refused == 0


def test_first_sights_claim_no_altitude_that_they_cannot_show():
    """Two numbers of a direction, seen five times from one place, against the position and the altitude."""
    errors = priors(position_north=1.0, position_east=1.0, height=0.0, time_offset=0.0, position_noise_m=0.02,
                    heading=0.0, mount_x=0.0, mount_y=0.0, mount_z=0.0)  # fmt: skip
    off = np.array((1.2, -1.2, 2.5))
    state = after_sights(1.0 + 0.0001 * np.arange(5), errors, 0.0, off)
    to = PLACE - vehicle_at(1.0) - body_at(1.0).apply(ARM) - off
    ground = np.array(((1.0, 0.0, -to[0] / to[2]), (0.0, 1.0, -to[1] / to[2])))  # d(place)/d(north, east, down)
    prior = np.diag((1.0, 1.0, 4.0))
    spread = ground @ prior @ ground.T + ground @ ground.T * SURVEY_M**2
    best = prior - prior @ ground.T @ np.linalg.solve(spread, ground @ prior)
    index = state.model.altitude
    assert state.cov[index, index] ** 0.5 > 0.97 * best[2, 2] ** 0.5
    assert state.cov[index, index] ** 0.5 < 1.1 * best[2, 2] ** 0.5
