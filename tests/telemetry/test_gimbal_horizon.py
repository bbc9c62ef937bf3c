"""From which zeros a gimbal's angles count: the vehicle's heading, north, the horizon or the body."""

import numpy as np
import pytest
from gimbals import BOOT_S, LOCKS, NO_TURN, asked, autopilot_clock, fed, fields, quaternion
from scipy.spatial.transform import Rotation

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.telemetry.attitude.history import AttitudeAt
from fwav_companion.telemetry.gimbal import Gimbal


def test_the_vehicles_heading_turns_a_gimbal_that_follows_it_but_not_one_that_counts_from_north():
    turned = AttitudeAt(quaternion(Rotation.from_euler("ZYX", [70, -15, 20], degrees=True)), (0.1, 0.2, 0.3), 0.0, 0.0)
    follows, north = fed(flags=32 | LOCKS), fed()
    assert asked(north, 4.1, turned).ned_from_gimbal == asked(north, 4.1).ned_from_gimbal
    w, x, y, z = asked(follows, 4.1, turned).ned_from_gimbal
    level = asked(north, 4.1).ned_from_gimbal
    expected = Rotation.from_euler("Z", 70, degrees=True) * Rotation.from_quat([*level[1:], level[0]])
    assert (Rotation.from_quat([x, y, z, w]).inv() * expected).magnitude() < 1e-9


def swaying(t_s):
    """A vehicle that rolls by 4 deg and pitches by 6 deg, heading 50 deg."""
    return Rotation.from_euler("ZYX", [50.0, 6.0 * np.sin(2.9 * t_s), 4.0 * np.cos(2.3 * t_s)], degrees=True)


LEVEL_CAMERA = Rotation.from_euler("ZYX", [70.0, -50.0, 0.0], degrees=True)


def carried(*, reports_body, flags, levelled="auto", seconds=12.0, body=swaying, device_id=1):
    """A gimbal that holds its camera level on a moving vehicle, and reports its angles from the horizon or the body."""
    gimbal, clock = Gimbal(device_id, levelled=levelled), autopilot_clock()

    def body_at(boot_ns):
        return AttitudeAt(quaternion(body(boot_ns * 1e-9 - BOOT_S)), (0.0, 0.0, 0.0), 0.0, 0.0)

    for k in range(round(10 * seconds)):
        t_s = 0.1 * k
        clock.on_arrival(BootNs(round((BOOT_S + t_s) * 1e9)), HostNs(round(t_s * 1e9)))
        reference = body(t_s) if reports_body else Rotation.from_euler("Z", 50.0, degrees=True)
        sent = fields(0.0, quaternion(reference.inv() * LEVEL_CAMERA), flags=flags, device_id=device_id)
        gimbal.on_message(sent._replace(time_boot_ms=round((BOOT_S + t_s) * 1e3)), HostNs(round(t_s * 1e9)))
        gimbal.compare(body_at, clock)
    then = BootNs(round((BOOT_S + seconds - 0.35) * 1e9))
    at = gimbal.at(then, clock, body_at(then))
    w, x, y, z = at.ned_from_gimbal
    return at, (Rotation.from_quat([x, y, z, w]).inv() * LEVEL_CAMERA).magnitude(), gimbal


@pytest.mark.parametrize("reports_body", [False, True])
def test_motion_shows_whether_reported_angles_count_from_the_horizon(reports_body):
    at, off, gimbal = carried(reports_body=reports_body, flags=32 | LOCKS)
    assert at.tilt_sigma == 0.0
    assert off < np.radians(0.1)
    assert gimbal.status(HostNs(0)).levelled is not reports_body


@pytest.mark.parametrize("reports_body", [False, True])
def test_until_motion_shows_it_both_readings_are_in_the_claim(reports_body):
    at, off, gimbal = carried(reports_body=reports_body, flags=32 | LOCKS, seconds=1.2)
    assert gimbal.status(HostNs(0)).levelled is None
    assert at.tilt_sigma > np.radians(0.5)
    assert off < 1.5 * at.tilt_sigma + np.radians(0.1)


@pytest.mark.parametrize("levelled", [False, True])
def test_configured_reading_counts_from_the_first_message(levelled):
    at, off, _ = carried(reports_body=not levelled, flags=32 | LOCKS, levelled=levelled, seconds=1.2)
    assert at.tilt_sigma == 0.0
    assert off < np.radians(0.1)


def test_angles_from_the_body_that_never_change_do_not_count_from_the_horizon():
    """An unlocked camera turns with the body: its constant angles look like those of a camera that is held level."""
    gimbal, clock = Gimbal(154), autopilot_clock()

    def body_at(boot_ns):
        return AttitudeAt(quaternion(swaying(boot_ns * 1e-9 - BOOT_S)), (0.0, 0.0, 0.0), 0.0, 0.0)

    for k in range(120):
        t_s = 0.1 * k
        clock.on_arrival(BootNs(round((BOOT_S + t_s) * 1e9)), HostNs(round(t_s * 1e9)))
        gimbal.on_message(fields(t_s, NO_TURN, flags=32), HostNs(round(t_s * 1e9)))
        gimbal.compare(body_at, clock)
    then = BootNs(round((BOOT_S + 11.6) * 1e9))
    at = gimbal.at(then, clock, body_at(then))
    w, x, y, z = at.ned_from_gimbal
    assert (Rotation.from_quat([x, y, z, w]).inv() * swaying(11.6)).magnitude() < np.radians(0.1)
    assert at.tilt_sigma > np.radians(1.0)


@pytest.mark.parametrize(("own_zero_deg", "reported"), [(0.0, False), (9.0, False), (-11.0, True), (70.0, True)])
def test_heading_that_differs_by_more_than_10_deg_is_reported_once_with_its_number(own_zero_deg, reported):
    gimbal, clock = Gimbal(154), autopilot_clock()
    body = AttitudeAt(quaternion(Rotation.from_euler("Z", 50.0, degrees=True)), (0.0, 0.0, 0.0), 0.0, 0.0)
    events = []
    for k in range(40):
        host_ns = HostNs(100_000_000 * k)
        sent = fields(0.1 * k, NO_TURN, flags=32 | LOCKS, delta_yaw=np.radians(50.0 + own_zero_deg))
        gimbal.on_message(sent, host_ns)
        events += gimbal.compare(lambda _: body, clock)
    assert len(events) == reported
    for event in events:
        assert event.deg == pytest.approx(own_zero_deg)
