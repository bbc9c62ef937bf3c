"""A gimbal's attitudes between its messages, by scipy; and the limits of its messages."""

from collections import namedtuple
from math import nan

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.telemetry.attitude.history import AttitudeAt
from fwav_companion.telemetry.clock.clock import Clock
from fwav_companion.telemetry.gimbal import Gimbal
from fwav_companion.telemetry.telemetry import Telemetry, TelemetryOptions
from fwav_companion.types import AutopilotKind, GimbalAt, Message, Reason

Fields = namedtuple("Fields", "time_boot_ms flags q delta_yaw gimbal_device_id")
EARTH, LOCKS = 64, 12
NO_TURN = (1.0, 0.0, 0.0, 0.0)
LEVEL = AttitudeAt(NO_TURN, (0.0, 0.0, 0.0), 0.0, 0.0)
BOOT_S, GIMBAL_S = 30.0, 700.0
"""Readings of the clocks at the host's zero."""


def fields(t_s, q, flags=EARTH, delta_yaw=nan, device_id=0):
    return Fields(round((GIMBAL_S + t_s) * 1e3), flags, tuple(q), delta_yaw, device_id)


def look(t_s):
    """A slow slew: pitch and yaw at even rates."""
    return Rotation.from_euler("ZYX", [10.0 + 8.0 * t_s, -60.0 + 5.0 * t_s, 1.0], degrees=True)


def quaternion(rotation):
    x, y, z, w = rotation.as_quat()
    return (w, x, y, z)


def autopilot_clock():
    clock = Clock()
    for k in range(60):
        clock.on_arrival(BootNs(round((BOOT_S + 0.1 * k) * 1e9)), HostNs(round(0.1e9 * k)))
    return clock


def fed(rate_hz=5.0, seconds=5.0, turn=look, **how):
    gimbal = Gimbal(154)
    for k in range(round(seconds * rate_hz) + 1):
        t_s = k / rate_hz
        gimbal.on_message(fields(t_s, quaternion(turn(t_s)), **how), HostNs(round(t_s * 1e9)))
    return gimbal


def asked(gimbal, t_s, body=LEVEL):
    return gimbal.at(BootNs(round((BOOT_S + t_s) * 1e9)), autopilot_clock(), body)


def test_between_two_messages_it_is_where_slerp_has_it():
    gimbal, nodes = fed(), np.arange(0.0, 5.01, 0.2)
    slerp = Slerp(nodes + 0.0005, Rotation.concatenate([look(t) for t in nodes]))
    for t_s in np.arange(3.0, 4.9, 0.037):
        at = asked(gimbal, t_s)
        assert isinstance(at, GimbalAt)
        w, x, y, z = at.ned_from_gimbal
        assert (Rotation.from_quat([x, y, z, w]).inv() * slerp(t_s)).magnitude() < 1e-4  # 0.1 ms of clock
        expected = (slerp(t_s).inv() * slerp(t_s + 1e-4)).as_rotvec() / 1e-4
        assert at.rates == pytest.approx(expected, abs=1e-3)


def test_attitude_that_is_old_at_its_stamp_is_that_of_an_earlier_instant():
    late = Gimbal(154, delay_s=0.08)
    for k in range(26):
        late.on_message(fields(0.2 * k, quaternion(look(0.2 * k - 0.08))), HostNs(round(0.2e9 * k)))
    w, x, y, z = asked(late, 4.1).ned_from_gimbal
    assert (Rotation.from_quat([x, y, z, w]).inv() * look(4.1)).magnitude() < 5e-4


@pytest.mark.parametrize(("flags", "from_north"), [(EARTH, True), (32, False)])
def test_reported_attitude_keeps_its_own_zero_of_yaw(flags, from_north):
    found = fed(flags=flags).reported_at(BootNs(round((BOOT_S + 4.1) * 1e9)), autopilot_clock())
    w, x, y, z = found.attitude
    assert (Rotation.from_quat([x, y, z, w]).inv() * look(4.1)).magnitude() < 5e-4
    assert found.from_north is from_north


def test_reported_attitude_beyond_the_newest_report_is_still_to_come():
    gimbal = fed()
    assert gimbal.reported_at(BootNs(round((BOOT_S + 5.1) * 1e9)), autopilot_clock()) is Reason.STALE_GIMBAL
    assert Gimbal(154).reported_at(BootNs(0), autopilot_clock()) is Reason.NO_GIMBAL


def test_doubt_grows_with_the_motion_the_gap_and_the_doubt_about_the_clock():
    smooth = asked(fed(), 4.1).sigma

    def swinging(t_s):
        return Rotation.from_euler("ZYX", [0.0, -60.0 + 6.0 * np.sin(2 * np.pi * 0.5 * t_s), 0.0], degrees=True)

    swings = fed(turn=swinging)
    amid, near, beyond = (asked(swings, t_s).sigma for t_s in (4.1, 4.02, 5.2))
    assert near < amid < beyond
    assert 3.0 * smooth < amid
    truth = swinging(4.1 - 0.0005)
    w, x, y, z = asked(swings, 4.1).ned_from_gimbal
    assert (Rotation.from_quat([x, y, z, w]).inv() * truth).magnitude() < 3.0 * amid


def test_motion_that_the_messages_do_not_show_is_not_taken_for_smooth():
    """Three swings a second, reported five times a second."""

    def shaking(t_s):
        return Rotation.from_euler("ZYX", [0.0, -60.0 + 2.0 * np.sin(2 * np.pi * 3.1 * t_s), 0.0], degrees=True)

    gimbal = fed(turn=shaking, seconds=8.0)
    errors, sigmas = [], []
    for t_s in np.arange(5.0, 5.9, 0.011):
        w, x, y, z = asked(gimbal, t_s).ned_from_gimbal
        errors.append((Rotation.from_quat([x, y, z, w]).inv() * shaking(t_s - 0.0005)).magnitude())
        sigmas.append(asked(gimbal, t_s).sigma)
    assert np.sqrt(np.mean(np.square(errors))) < 2.0 * np.sqrt(np.mean(np.square(sigmas)))


@pytest.mark.parametrize(
    ("t_s", "reason"),
    [(5.35, Reason.STALE_GIMBAL), (60.0, Reason.STALE_GIMBAL), (-1.0, Reason.NO_GIMBAL), (0.5, Reason.NO_GIMBAL)],
)
def test_far_from_every_message_there_is_a_reason_and_no_attitude(t_s, reason):
    assert asked(fed(), t_s) is reason


def test_a_hole_is_not_bridged():
    gimbal = fed(seconds=4.0)
    for t_s in (5.2, 5.4):
        gimbal.on_message(fields(t_s, quaternion(look(t_s))), HostNs(round(t_s * 1e9)))
    assert asked(gimbal, 4.6) is Reason.NO_GIMBAL
    assert isinstance(asked(gimbal, 5.3), GimbalAt)


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


def test_the_vehicles_heading_turns_a_gimbal_that_follows_it_but_not_one_that_counts_from_north():
    turned = AttitudeAt(quaternion(Rotation.from_euler("ZYX", [70, -15, 20], degrees=True)), (0.1, 0.2, 0.3), 0.0, 0.0)
    follows, north = fed(flags=32 | LOCKS), fed()
    assert asked(north, 4.1, turned).ned_from_gimbal == asked(north, 4.1).ned_from_gimbal
    w, x, y, z = asked(follows, 4.1, turned).ned_from_gimbal
    level = asked(north, 4.1).ned_from_gimbal
    expected = Rotation.from_euler("Z", 70, degrees=True) * Rotation.from_quat([*level[1:], level[0]])
    assert (Rotation.from_quat([x, y, z, w]).inv() * expected).magnitude() < 1e-9


def test_a_flood_is_kept_within_bounds_and_a_restart_begins_again():
    gimbal = Gimbal(154)
    for k in range(3000):
        gimbal.on_message(fields(0.005 * k, NO_TURN), HostNs(round(5e6 * k)))
    assert len(gimbal._series.looks) <= 512
    for k in range(4):
        restarted = Fields(k * 200, EARTH, NO_TURN, nan, 0)
        gimbal.on_message(restarted, HostNs(round((16.0 + 0.2 * k) * 1e9)))
    assert len(gimbal._series.looks) <= 2


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


def test_attitude_less_certain_than_six_degrees_is_refused_as_gimbal_gap():
    def wild(t_s):
        return Rotation.from_euler("ZYX", [0.0, -60.0 + 40.0 * np.sin(13.0 * t_s), 0.0], degrees=True)

    assert asked(fed(turn=wild), 4.1) is Reason.GIMBAL_GAP


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


@pytest.mark.parametrize(("near_s", "expected"), [(0.1, True), (-0.1, True), (0.6, False)])
def test_one_attitude_around_a_photograph_is_enough(near_s, expected):
    """Ten seconds from photograph to photograph, and one attitude at each."""
    gimbal = Gimbal(1)
    for k in range(6):
        sent = fields(0.0, quaternion(look(0.0)), device_id=1)._replace(time_boot_ms=round((BOOT_S + 10.0 * k) * 1e3))
        gimbal.on_message(sent, HostNs(round(10e9 * k)))
    at = gimbal.at(BootNs(round((BOOT_S + 50.0 + near_s) * 1e9)), autopilot_clock(), LEVEL)
    assert isinstance(at, GimbalAt) is expected
    if expected:
        w, x, y, z = at.ned_from_gimbal
        assert (look(0.0).inv() * Rotation.from_quat([x, y, z, w])).magnitude() < 1e-6
        assert at.sigma == pytest.approx(0.01, rel=0.05)


@pytest.mark.parametrize("rate", [0.5, 0.9, 2.0])
def test_a_simulators_gimbal_is_placed_by_a_clock_of_the_simulators_rate(rate):
    """Both clocks run at this rate and are known by arrivals alone; the gimbal turns at 8 deg/s of them."""
    gimbal, autopilot = Gimbal(154, rate), Clock(rate)
    for tenth in range(401):
        t_s, host_ns = rate * 0.1 * tenth, HostNs(100_000_000 * tenth)
        autopilot.on_arrival(BootNs(round((BOOT_S + t_s) * 1e9)), host_ns)
        gimbal.on_message(fields(t_s, quaternion(look(t_s))), host_ns)
    then_s = rate * 39.7
    found = gimbal.at(BootNs(round((BOOT_S + then_s) * 1e9)), autopilot, LEVEL)
    assert isinstance(found, GimbalAt)
    off = (look(then_s).inv() * Rotation.from_quat(np.roll(found.ned_from_gimbal, -1))).magnitude()
    assert np.degrees(off) < 0.05


def test_the_rate_of_telemetry_is_that_of_its_gimbal():
    telemetry = Telemetry(TelemetryOptions(gimbal_device_id=154, clock_rate=0.5))
    for tenth in range(200):
        t_s, host_ns = 0.05 * tenth, HostNs(100_000_000 * tenth)
        message = Message("GIMBAL_DEVICE_ATTITUDE_STATUS", 1, 154, "", fields(t_s, NO_TURN))
        telemetry.on_gimbal(message, 1, host_ns)
    reported = telemetry.status(HostNs(19_900_000_000)).gimbal
    assert reported.age_s == pytest.approx(0.0, abs=0.002)


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


@pytest.mark.parametrize("spacing_s", [0.1, 0.2, 0.5, 1.0])
def test_slow_reports_of_a_still_gimbal_are_interpolated_and_extrapolated_in_their_own_intervals(spacing_s):
    def still(_t_s):
        return look(0.0)

    gimbal = fed(rate_hz=1.0 / spacing_s, seconds=12.0, turn=still)
    for t_s in (12.0 - 0.5 * spacing_s, 12.0 + 1.4 * spacing_s):
        at = asked(gimbal, t_s)
        assert isinstance(at, GimbalAt), t_s
        w, x, y, z = at.ned_from_gimbal
        assert (Rotation.from_quat([x, y, z, w]).inv() * look(0.0)).magnitude() < 1e-6
    assert asked(gimbal, 12.0 + max(0.3, 1.5 * spacing_s) + 0.02) is Reason.STALE_GIMBAL


def test_slew_between_reports_a_second_apart_is_refused_as_gimbal_gap():
    def slewing(t_s):
        return Rotation.from_euler("ZYX", [40.0 * np.sin(1.9 * t_s), -60.0, 0.0], degrees=True)

    assert asked(fed(rate_hz=1.0, seconds=12.0, turn=slewing), 11.5) is Reason.GIMBAL_GAP


@pytest.mark.parametrize("delay_s", [0.0, 0.08])
def test_configured_delay_dates_attitudes_back(delay_s):
    gimbal = Gimbal(154, delay_s=delay_s)
    for k in range(26):
        gimbal.on_message(fields(0.2 * k, quaternion(look(0.2 * k - delay_s))), HostNs(200_000_000 * k))
    w, x, y, z = asked(gimbal, 4.1).ned_from_gimbal
    assert (Rotation.from_quat([x, y, z, w]).inv() * look(4.1)).magnitude() < np.radians(0.02)


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
