"""A gimbal's attitudes between its messages, by scipy; and where there is none."""

from math import nan

import numpy as np
import pytest
from gimbals import (
    BOOT_S,
    EARTH,
    LEVEL,
    NO_TURN,
    Fields,
    asked,
    autopilot_clock,
    fed,
    fields,
    look,
    quaternion,
)
from scipy.spatial.transform import Rotation, Slerp

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.telemetry.attitude.history import AttitudeAt
from fwav_companion.telemetry.clock.clock import Clock
from fwav_companion.telemetry.gimbal import Gimbal
from fwav_companion.telemetry.telemetry import Telemetry, TelemetryOptions
from fwav_companion.types import GimbalAt, Message, Reason


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


@pytest.mark.parametrize(("flags", "from_north"), [(EARTH, True), (32, False)])
def test_reported_attitude_keeps_its_own_zero_of_yaw(flags, from_north):
    found = fed(flags=flags).reported_at(BootNs(round((BOOT_S + 4.1) * 1e9)), autopilot_clock(), LEVEL)
    w, x, y, z = found.attitude
    assert (Rotation.from_quat([x, y, z, w]).inv() * look(4.1)).magnitude() < 5e-4
    assert found.from_north is from_north


def test_reported_attitude_that_counts_from_the_body_is_levelled():
    """By the vehicle's tilt, its yaw still from the vehicle's heading."""
    banked = Rotation.from_euler("ZYX", [70.0, 10.0, -20.0], degrees=True)
    body, gimbal = AttitudeAt(quaternion(banked), (0.0, 0.0, 0.0), 0.0, 0.0), fed(flags=32)
    found = gimbal.reported_at(BootNs(round((BOOT_S + 4.1) * 1e9)), autopilot_clock(), body)
    w, x, y, z = found.attitude
    level = Rotation.from_euler("Z", 70.0, degrees=True).inv() * banked * look(4.1)
    assert (Rotation.from_quat([x, y, z, w]).inv() * level).magnitude() < 5e-4


def test_reported_attitude_beyond_the_newest_report_is_still_to_come():
    gimbal = fed()
    assert gimbal.reported_at(BootNs(round((BOOT_S + 5.1) * 1e9)), autopilot_clock(), LEVEL) is Reason.STALE_GIMBAL
    assert Gimbal(154).reported_at(BootNs(0), autopilot_clock(), LEVEL) is Reason.NO_GIMBAL


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


def test_a_flood_is_kept_within_bounds_and_a_restart_begins_again():
    gimbal = Gimbal(154)
    for k in range(3000):
        gimbal.on_message(fields(0.005 * k, NO_TURN), HostNs(round(5e6 * k)))
    assert len(gimbal._series.looks) <= 512
    for k in range(4):
        restarted = Fields(k * 200, EARTH, NO_TURN, nan, 0)
        gimbal.on_message(restarted, HostNs(round((16.0 + 0.2 * k) * 1e9)))
    assert len(gimbal._series.looks) <= 2


def test_attitude_less_certain_than_six_degrees_is_refused_as_gimbal_gap():
    def wild(t_s):
        return Rotation.from_euler("ZYX", [0.0, -60.0 + 40.0 * np.sin(13.0 * t_s), 0.0], degrees=True)

    assert asked(fed(turn=wild), 4.1) is Reason.GIMBAL_GAP


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
