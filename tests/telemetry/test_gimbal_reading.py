"""Which messages are a gimbal's attitudes, and what is refused by name."""

from collections import namedtuple
from math import nan

import numpy as np
import pytest
from gimbals import BOOT_S, LEVEL, NO_TURN, asked, autopilot_clock, fed, fields, quaternion
from scipy.spatial.transform import Rotation

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.telemetry.attitude.history import AttitudeAt
from fwav_companion.telemetry.gimbal import Gimbal
from fwav_companion.types import AutopilotKind, Message, Reason


@pytest.mark.parametrize(
    "broken",
    [
        fields(5.1, (nan,) * 4),
        fields(5.1, (0.0,) * 4),
        fields(5.1, (2.0, 0.0, 0.0, 0.0)),
        fields(5.1, NO_TURN, flags=32 | 64),
    ],
)
def test_what_holds_no_attitude_is_counted_and_changes_nothing(broken):
    gimbal, other = fed(), fed()
    gimbal.on_message(broken, HostNs(round(5.1e9)))
    assert asked(gimbal, 4.1) == asked(other, 4.1)
    assert gimbal.status(HostNs(6_000_000_000)).refused == 1


@pytest.mark.parametrize(
    ("device_id", "component", "told_id", "meant"),
    [
        (154, 154, 0, True),
        (154, 155, 0, False),
        (2, 1, 2, True),
        (2, 1, 3, False),
        (2, 154, 2, False),
        (1, 1, 0, False),
    ],
)
def test_whose_message_it_is(device_id, component, told_id, meant):
    message = Message("GIMBAL_DEVICE_ATTITUDE_STATUS", 1, component, "", fields(0.0, (1, 0, 0, 0), device_id=told_id))
    assert Gimbal(device_id).is_meant(message, 1) is meant
    assert not Gimbal(device_id).is_meant(Message("ATTITUDE", 1, component, "", None), 1)


Orientation = namedtuple("Orientation", "time_boot_ms roll pitch yaw yaw_absolute")
MountStatus = namedtuple("MountStatus", "pointing_a pointing_b pointing_c")
TURNED = AttitudeAt(quaternion(Rotation.from_euler("ZYX", [50.0, 12.0, -7.0], degrees=True)), (0.0, 0.0, 0.0), 0.0, 0.0)
"""The body: heading 50 deg; its roll and pitch do not count for a levelled gimbal."""


def older(name, yaw_absolute):
    """MOUNT_ORIENTATION or MOUNT_STATUS of a gimbal that looks 60 deg down and 20 deg to the right, at 5 Hz."""
    gimbal, clock = Gimbal(1), autopilot_clock()
    for k in range(26):
        t_s = 0.2 * k
        if name == "MOUNT_STATUS":
            sent = MountStatus(-6000, 100, 2000)
        else:
            sent = Orientation(round((BOOT_S + t_s) * 1e3), 1.0, -60.0, 20.0, yaw_absolute)
        message = Message(name, 1, 1, "autopilot", sent)
        assert gimbal.is_meant(message, 1)
        gimbal.on_older_message(message, clock, HostNs(round(t_s * 1e9)))
    return gimbal


@pytest.mark.parametrize(
    ("name", "yaw_absolute", "heading_deg"),
    [
        ("MOUNT_STATUS", nan, 70.0),
        ("MOUNT_ORIENTATION", nan, 70.0),
        ("MOUNT_ORIENTATION", 0.0, 70.0),
        ("MOUNT_ORIENTATION", 95.0, 95.0),
    ],
)
def test_older_gimbals_report_angles_from_the_horizon(name, yaw_absolute, heading_deg):
    at = older(name, yaw_absolute).at(BootNs(round((BOOT_S + 4.1) * 1e9)), autopilot_clock(), TURNED)
    true = Rotation.from_euler("ZYX", [heading_deg, -60.0, 1.0], degrees=True)
    w, x, y, z = at.ned_from_gimbal
    assert (true.inv() * Rotation.from_quat([x, y, z, w])).magnitude() < 1e-6


def test_the_newer_message_replaces_the_older_ones():
    gimbal = older("MOUNT_ORIENTATION", 95.0)
    level = quaternion(Rotation.identity())
    for k in range(10):
        sent = fields(5.2 + 0.2 * k, level, device_id=1)._replace(time_boot_ms=round((BOOT_S + 5.2 + 0.2 * k) * 1e3))
        gimbal.on_message(sent, HostNs(round((5.2 + 0.2 * k) * 1e9)))
    gimbal.on_older_message(
        Message("MOUNT_STATUS", 1, 1, "autopilot", MountStatus(-6000, 0, 0)), autopilot_clock(), HostNs(7_100_000_000)
    )
    at = gimbal.at(BootNs(round((BOOT_S + 6.9) * 1e9)), autopilot_clock(), LEVEL)
    assert at.ned_from_gimbal == pytest.approx(NO_TURN, abs=1e-6)


def test_both_frame_flags_are_refused_by_name():
    gimbal = Gimbal(154)
    for k in range(10):
        gimbal.on_message(fields(0.2 * k, NO_TURN, flags=32 | 64), HostNs(200_000_000 * k))
    assert asked(gimbal, 1.7) is Reason.GIMBAL_FLAGS
    assert gimbal.status(HostNs(2_000_000_000)).refused_as == "gimbal_flags"


@pytest.mark.parametrize(
    ("kind", "taken"), [(AutopilotKind.PX4, False), (AutopilotKind.ARDUPILOT, True), (AutopilotKind.OTHER, True)]
)
def test_mount_orientation_of_px4_is_refused_and_others_count_with_3_deg(kind, taken):
    gimbal, clock = Gimbal(1), autopilot_clock()
    for k in range(26):
        sent = Orientation(round((BOOT_S + 0.2 * k) * 1e3), 1.0, -60.0, 20.0, nan)
        gimbal.on_older_message(Message("MOUNT_ORIENTATION", 1, 1, "", sent), clock, HostNs(200_000_000 * k), kind)
    at = gimbal.at(BootNs(round((BOOT_S + 4.1) * 1e9)), clock, LEVEL)
    if taken:
        assert at.tilt_sigma == pytest.approx(np.radians(3.0))
    else:
        assert at is Reason.GIMBAL_SETPOINT
