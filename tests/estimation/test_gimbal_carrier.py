"""A gimbal as the carrier: its yaw about the vehicle's heading, a delay that shifts it alone, and its errors' axes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fwav_companion.estimation.attitudes import Attitudes
from fwav_companion.estimation.errors import GIMBAL_DELAY, GIMBAL_SHARED
from fwav_companion.estimation.measurement import project
from fwav_companion.estimation.path_samples import Carrier
from fwav_companion.estimation.vehicle_path import VehiclePath

DELAY_S = 0.06
AT = np.array([2.0, 3.1, 4.25])


def body(t):
    """A vehicle that turns and banks."""
    return Rotation.from_euler("ZYX", np.stack([0.8 * t, 0.2 * np.sin(1.3 * t), 0.3 * np.cos(t)], -1))


def about_heading(t):
    """A gimbal that swings in pitch and yaw."""
    return Rotation.from_euler(
        "ZYX", np.stack([0.3 + 0.2 * np.sin(0.9 * t), -1.0 + 0.15 * np.cos(1.1 * t), 0.0 * t], -1)
    )


def ned_from_gimbal(t):
    return Rotation.from_euler("Z", body(t).as_euler("ZYX")[:, :1]) * about_heading(t)


def wxyz(rotation):
    return rotation.as_quat()[:, [3, 0, 1, 2]]


@pytest.fixture(scope="module", params=["heading", "north"])
def carrier(request):
    """The carrier by reports of a gimbal that are late by DELAY_S; yaw counts from the heading or from north."""
    path = VehiclePath(0.01, 0.01)
    t = np.arange(0.0, 6.0, 0.02)
    for stamp in np.arange(0.0, 6.0, 0.1):
        path.append(float(stamp), np.array([2.0 * stamp, -stamp, 10.0]), np.array([2.0, -1.0, 0.0]))
    attitudes, gimbal = Attitudes(1e-4, 0.0), Attitudes(1e-4, 0.0)
    own = about_heading if request.param == "heading" else ned_from_gimbal
    for stamp, of_body, of_gimbal in zip(t, wxyz(body(t)), wxyz(own(t - DELAY_S)), strict=True):
        attitudes.append(float(stamp), of_body)
        gimbal.append(float(stamp), of_gimbal)
    found = Carrier(attitudes, path.samples, gimbal=gimbal)
    found.yaw_from_north = request.param == "north"
    return found


def test_pose_at_the_gimbals_delay_is_the_true_one(carrier):
    poses = carrier.poses(AT, carrier.rates(AT, DELAY_S), DELAY_S)
    off = Rotation.from_matrix(np.moveaxis(poses.rotation, -1, 0)).inv() * ned_from_gimbal(AT)
    assert np.abs(off.as_rotvec()).max() < 1e-4
    wrong = carrier.poses(AT, carrier.rates(AT), 0.0).rotation
    assert np.abs(wrong - poses.rotation).max() > 0.003


def pose_at(carrier, t, delay=0.0):
    """The pose at one instant."""
    instants = np.array([t])
    return carrier.poses(instants, carrier.live_rates(instants, delay), delay)


def test_rate_is_that_of_the_camera_with_the_turning_vehicle(carrier):
    instants = np.linspace(1.5, 4.5, 400)
    rates = carrier.rates(instants, DELAY_S)
    step = 1e-4
    true = (ned_from_gimbal(instants - step).inv() * ned_from_gimbal(instants + step)).as_rotvec().T / (2 * step)
    assert rates.whole == pytest.approx(true, abs=0.03)


def test_jacobian_by_the_gimbals_delay_turns_the_gimbal_alone(carrier):
    targets = np.array([[9.0, 4.0, 12.0], [3.0, -8.0, 1.0], [0.0, 0.0, 0.0]])
    shared = np.zeros(GIMBAL_SHARED)
    rays = np.array([[1.0, 0.0, 0.0], [0.95, 0.2, 0.1], [0.95, -0.2, 0.15]]).T
    rays /= np.linalg.norm(rays, axis=0)
    tangents = np.repeat(np.eye(3)[1:, :, None], 3, -1)

    def found(delay):
        at = shared.copy()
        at[GIMBAL_DELAY] = delay
        poses = carrier.poses(AT, carrier.live_rates(AT, delay), delay)
        return project(poses, rays, tangents, at, targets, np.zeros((3, 1)), np.zeros(3))

    exact, step = found(DELAY_S), 1e-3
    numeric = -(found(DELAY_S + step).residual - found(DELAY_S - step).residual) / (2 * step)
    seen = exact.visible
    assert seen.sum() >= 2
    assert exact.shared[:, GIMBAL_DELAY, seen] == pytest.approx(numeric[:, seen], abs=0.05 * np.abs(numeric).max())


def test_errors_of_a_gimbal_that_looks_straight_down_turn_about_its_own_axes():
    carrier = Carrier(Attitudes(1e-4, 0.0), VehiclePath(0.01, 0.01).samples, gimbal=Attitudes(1e-4, 0.0))
    down = wxyz(Rotation.from_euler("ZYX", [[0.5, -np.pi / 2, 0.0]]))[0]
    for stamp in np.arange(0.0, 3.0, 0.02):
        carrier.body.append(float(stamp), np.array([1.0, 0.0, 0.0, 0.0]))
        carrier.gimbal.append(float(stamp), down)
    for stamp in (0.0, 1.0, 2.0, 3.0):
        carrier.path.buffer.append(stamp, np.zeros(9))
    poses = pose_at(carrier, 1.5)
    assert poses.level[:, 0].tolist() == [0.0, 1.0, 0.0]
    assert np.isfinite(poses.rate).all()


def test_snapshot_keeps_both_streams(carrier):
    snapshot = carrier.copy()
    assert snapshot.yaw_from_north == carrier.yaw_from_north
    assert pose_at(snapshot, 3.0, DELAY_S).rotation == pytest.approx(pose_at(carrier, 3.0, DELAY_S).rotation)
