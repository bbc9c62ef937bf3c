"""The autopilot's local frame as the world: when, where its origin and ground lie, and how far it drifts."""

from math import hypot

import pytest
from telemetry_messages import MS, Autopilot

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.telemetry import LocalWorld, OriginSet, PositionJumped, PositionSource, Rebooted, RelativeWorld

FLOW = 1 | 2 | 4 | 8 | 32 | 256
"""EKF_STATUS_REPORT of a vehicle with optical flow: no absolute position."""


def kinds(autopilot, kind):
    return [event for event in autopilot.events if isinstance(event, kind)]


def indoors(until_ms, *, flags=FLOW, from_ms=0, speed_m_s=0.0, every_ms=100, **options):
    """An autopilot without GNSS that flies north at 3 m over its take-off ground, 0.5 m below its local origin."""
    autopilot = Autopilot(**options)
    fly(autopilot, from_ms, until_ms, flags=flags, speed_m_s=speed_m_s, every_ms=every_ms)
    return autopilot


def fly(autopilot, from_ms, until_ms, *, flags=FLOW, speed_m_s=0.0, every_ms=100, local=True):
    for boot_ms in range(from_ms, until_ms, every_ms):
        if boot_ms % 1000 == 0:
            autopilot.send("HEARTBEAT", boot_ms, base_mode=128)
            autopilot.send("EKF_STATUS_REPORT", boot_ms, flags=flags)
        autopilot.send("GLOBAL_POSITION_INT", boot_ms, lat=0, lon=0, relative_alt=3000)
        if local:
            x = speed_m_s * boot_ms / 1000.0
            autopilot.send("LOCAL_POSITION_NED", boot_ms, x=x, y=-2.0, z=-2.5, vx=speed_m_s)
        autopilot.send("ATTITUDE", boot_ms)


def test_without_a_global_position_a_good_local_one_is_the_world_ten_seconds_after_the_first_attitude():
    autopilot = indoors(12_000)
    assert kinds(autopilot, LocalWorld) == [LocalWorld(late=False, home_down_m=pytest.approx(0.5))]
    assert kinds(autopilot, RelativeWorld) == []
    world = autopilot.telemetry.world
    assert (world.local, world.relative, world.plane) == (True, False, None)
    assert world.position_in_use == "local"
    state = autopilot.telemetry.state_at(BootNs(11_900 * MS))
    assert state.position_ned == pytest.approx((0.0, -2.0, -2.5))


def test_positions_of_the_local_world_move_with_their_velocity():
    autopilot = indoors(20_000, speed_m_s=1.7)
    state = autopilot.telemetry.state_at(BootNs(19_550 * MS))
    assert state.position_ned == pytest.approx((1.7 * 19.5495, -2.0, -2.5), abs=1e-3)
    assert state.velocity_ned == pytest.approx((1.7, 0.0, 0.0))


@pytest.mark.parametrize("flags", [FLOW & ~8, FLOW | 128, None])
def test_local_position_that_the_filter_does_not_vouch_for_is_not_used(flags):
    autopilot = Autopilot()
    for boot_ms in range(0, 12_000, 100):
        autopilot.send("HEARTBEAT", boot_ms, base_mode=128)
        if flags is not None:
            autopilot.send("EKF_STATUS_REPORT", boot_ms, flags=flags)
        autopilot.send("LOCAL_POSITION_NED", boot_ms)
        autopilot.send("ATTITUDE", boot_ms)
    assert kinds(autopilot, LocalWorld) == []
    assert kinds(autopilot, RelativeWorld) == [RelativeWorld()]
    assert autopilot.telemetry.world.position_in_use == "none"


def test_local_position_that_stopped_before_the_decision_is_not_used():
    autopilot = Autopilot()
    fly(autopilot, 0, 8_000)
    fly(autopilot, 8_000, 12_000, local=False)
    assert kinds(autopilot, LocalWorld) == []
    assert kinds(autopilot, RelativeWorld) == [RelativeWorld()]


def test_local_position_that_becomes_good_in_a_relative_world_is_taken_as_late():
    autopilot = Autopilot()
    fly(autopilot, 0, 15_000, flags=FLOW | 128)
    fly(autopilot, 15_000, 17_000)
    assert kinds(autopilot, LocalWorld) == [LocalWorld(late=True, home_down_m=pytest.approx(0.5))]
    assert autopilot.telemetry.world.relative is False


def test_local_position_beside_a_global_one_changes_nothing():
    autopilot = Autopilot()
    autopilot.send("GLOBAL_POSITION_INT", 0)
    for boot_ms in range(100, 15_000, 100):
        autopilot.send("EKF_STATUS_REPORT", boot_ms, flags=831)
        autopilot.send("LOCAL_POSITION_NED", boot_ms, x=50.0)
        autopilot.send("ATTITUDE", boot_ms)
        autopilot.send("GLOBAL_POSITION_INT", boot_ms)
    assert kinds(autopilot, LocalWorld) == []
    assert autopilot.telemetry.world.position_in_use == "global"
    state = autopilot.telemetry.state_at(BootNs(14_850 * MS))
    assert state.position_bias_m is None, "by the receiver, which sent nothing"


def test_position_none_is_never_local():
    autopilot = indoors(15_000, position="none")
    assert kinds(autopilot, LocalWorld) == []
    assert autopilot.telemetry.world.relative is True


@pytest.mark.parametrize("speed_m_s", [0.0, 2.0, 20.0])
def test_position_error_of_the_local_world_is_the_drift_of_the_way_flown(speed_m_s):
    """Over ten seconds of it, at the default of 1 %, on top of 5 cm."""
    autopilot = indoors(20_000, speed_m_s=speed_m_s)
    state = autopilot.telemetry.state_at(BootNs(19_900 * MS))
    assert state.position_bias_m == pytest.approx(hypot(0.05, 0.01 * 10.0 * speed_m_s), rel=0.03)
    assert state.position_drifts


def test_drift_follows_the_configured_share_of_the_way():
    autopilot = indoors(20_000, speed_m_s=2.0, local_drift=0.1)
    assert autopilot.telemetry.state_at(BootNs(19_900 * MS)).position_bias_m == pytest.approx(2.0, rel=0.05)


def test_global_position_after_the_local_one_stopped_is_late_and_the_local_frame_ends():
    autopilot = indoors(15_000, speed_m_s=1.0)
    fly(autopilot, 15_000, 18_000, local=False)
    autopilot.send("GLOBAL_POSITION_INT", 18_000)
    autopilot.send("ATTITUDE", 18_000)
    assert [event.late for event in kinds(autopilot, OriginSet)] == [True]
    assert kinds(autopilot, PositionSource) == kinds(autopilot, PositionJumped) == []
    world = autopilot.telemetry.world
    assert (world.local, world.home_down_m, world.position_in_use) == (False, 0.0, "global")
    assert autopilot.telemetry.state_at(BootNs(16_000 * MS)).position_ned is None
    state = autopilot.telemetry.state_at(BootNs(18_000 * MS + MS))
    assert state.position_ned == pytest.approx((0.0, 0.0, -10.0), abs=0.01)
    assert state.position_bias_m is None


def test_reset_of_the_local_position_is_a_jump_of_the_position():
    autopilot = indoors(15_000)
    autopilot.send("LOCAL_POSITION_NED", 15_000, x=3.0, y=-2.0, z=-2.5)
    (jump,) = kinds(autopilot, PositionJumped)
    assert (jump.north_m, jump.east_m) == pytest.approx((3.0, 0.0))


def test_reboot_ends_the_local_frame_and_the_wait_begins_anew():
    autopilot = indoors(15_000)
    autopilot.host_at_boot += 15_100 * MS
    autopilot.events.clear()
    fly(autopilot, 1000, 12_000)
    (rebooted,) = kinds(autopilot, Rebooted)
    assert rebooted.frame_ended
    (local,) = kinds(autopilot, LocalWorld)
    assert not local.late


def test_home_surface_of_a_vehicle_without_a_height_is_its_own_level_at_the_decision():
    autopilot = Autopilot()
    for boot_ms in range(0, 12_000, 100):
        autopilot.send("EKF_STATUS_REPORT", boot_ms, flags=FLOW)
        autopilot.send("LOCAL_POSITION_NED", boot_ms, z=-0.2)
        autopilot.send("ATTITUDE", boot_ms)
    assert kinds(autopilot, LocalWorld) == [LocalWorld(late=False, home_down_m=pytest.approx(-0.2))]


# Global and local come and go in flight.


def met(*, north_m=0.0, east_m=0.0):
    """Latitude and longitude, degE7, of a place north and east of the messages' default one."""
    return {"lat": 473_977_420 + round(north_m / 0.0111177), "lon": 85_455_940 + round(east_m / 0.0075465)}


def test_global_position_that_comes_in_flight_leaves_neds_zero_and_places_it_on_the_earth():
    autopilot = indoors(15_000, speed_m_s=1.0)
    autopilot.send("GLOBAL_POSITION_INT", 15_000, alt=500_000, relative_alt=3_000)
    autopilot.send("ATTITUDE", 15_000)
    (origin,) = kinds(autopilot, OriginSet)
    (source,) = kinds(autopilot, PositionSource)
    assert (origin.late, source.local, source.jump_sigma_m) == (False, False, 0.0)
    assert source.transfer_sigma_m == pytest.approx(1.0), "a receiver that says nothing of its accuracy"
    state = autopilot.telemetry.state_at(BootNs(15_001 * MS))
    assert state.position_ned == pytest.approx((15.0, -2.0, -2.5), abs=0.02), "where the local position had it"
    plane = autopilot.telemetry.world.plane
    assert origin.origin == source.origin == plane.origin
    place = plane.geodetic_from_ned((15.0, -2.0, -2.5))
    assert (place.lat_deg, place.lon_deg) == pytest.approx((47.3977420, 8.5455940), abs=2e-7)
    assert place.alt_amsl_m == pytest.approx(500.0, abs=0.01)
    assert autopilot.telemetry.world.home_down_m == pytest.approx(0.5), "as before"
    assert autopilot.telemetry.world.take_off.place.alt_amsl_m == pytest.approx(497.0)
    assert kinds(autopilot, PositionJumped) == []


def test_local_position_carries_a_lost_global_one_on_without_a_step():
    autopilot = Autopilot(attitudes_kept_s=10.0)
    for boot_ms in range(0, 10_000, 100):
        autopilot.send("HEARTBEAT", boot_ms, base_mode=128)
        autopilot.send("EKF_STATUS_REPORT", boot_ms, flags=FLOW)
        autopilot.send("LOCAL_POSITION_NED", boot_ms, x=100.0 + boot_ms / 1000.0, y=7.0, z=-12.0, vx=1.0)
        autopilot.send("ATTITUDE", boot_ms)
        if boot_ms < 5_000:
            autopilot.send("GLOBAL_POSITION_INT", boot_ms, vx=100, **met(north_m=boot_ms / 1000.0))
    (source,) = kinds(autopilot, PositionSource)
    assert source.local
    assert 6.4 < source.boot_ns / 1e9 < 6.6, "1.5 s after the last global position"
    assert source.origin == autopilot.telemetry.world.plane.origin
    assert autopilot.telemetry.world.position_in_use == "local"
    for boot_ms in (7_000, 9_500):
        state = autopilot.telemetry.state_at(BootNs(boot_ms * MS))
        assert state.position_ned == pytest.approx((boot_ms / 1000.0, 0.0, -10.0), abs=0.05)
    assert kinds(autopilot, PositionJumped) == []
    assert autopilot.telemetry.state_at(BootNs(9_500 * MS)).position_bias_m >= 1.0, "the receiver's error stays in it"


def test_global_position_that_comes_back_is_taken_at_once_with_the_drift_as_a_step_of_the_error():
    autopilot = Autopilot()
    for boot_ms in range(0, 12_000, 100):
        autopilot.send("HEARTBEAT", boot_ms, base_mode=128)
        autopilot.send("EKF_STATUS_REPORT", boot_ms, flags=FLOW)
        autopilot.send("LOCAL_POSITION_NED", boot_ms)
        autopilot.send("ATTITUDE", boot_ms)
        if not 3_000 < boot_ms < 10_000:
            autopilot.send("GLOBAL_POSITION_INT", boot_ms, **met(north_m=0.4 if boot_ms > 5_000 else 0.0))
    lost, back = kinds(autopilot, PositionSource)
    assert (lost.local, back.local) == (True, False)
    assert (back.transfer_sigma_m, back.jump_sigma_m >= 1.0) == (0.0, True)
    assert autopilot.telemetry.world.position_in_use == "global"
    assert autopilot.telemetry.state_at(BootNs(11_500 * MS)).position_ned[0] == pytest.approx(0.4, abs=0.02)


def test_silence_of_all_messages_is_no_loss_of_the_global_position():
    autopilot = Autopilot()
    for boot_ms in (*range(0, 5_000, 100), *range(8_000, 11_000, 100)):
        if boot_ms != 8_000:  # the first message after the silence is a local position, as the last one before it
            autopilot.send("GLOBAL_POSITION_INT", boot_ms)
        autopilot.send("EKF_STATUS_REPORT", boot_ms + 40, flags=831)
        autopilot.send("LOCAL_POSITION_NED", boot_ms + 50)
        autopilot.send("ATTITUDE", boot_ms + 60)
    assert kinds(autopilot, PositionSource) == []


def test_slow_global_positions_are_not_lost_between_two_of_them():
    autopilot = Autopilot()
    for boot_ms in range(0, 15_000, 100):
        autopilot.send("EKF_STATUS_REPORT", boot_ms, flags=831)
        autopilot.send("LOCAL_POSITION_NED", boot_ms)
        autopilot.send("ATTITUDE", boot_ms)
        if boot_ms % 1_000 == 0:
            autopilot.send("GLOBAL_POSITION_INT", boot_ms)
    assert kinds(autopilot, PositionSource) == []


def test_lost_global_position_is_not_carried_on_by_a_local_one_that_nothing_vouches_for():
    autopilot = Autopilot()
    for boot_ms in range(0, 9_000, 100):
        autopilot.send("EKF_STATUS_REPORT", boot_ms, flags=1 | 4 | 32)
        autopilot.send("HEARTBEAT", boot_ms, base_mode=128)
        autopilot.send("LOCAL_POSITION_NED", boot_ms)
        autopilot.send("ATTITUDE", boot_ms)
        if boot_ms < 3_000:
            autopilot.send("GLOBAL_POSITION_INT", boot_ms)
    assert kinds(autopilot, PositionSource) == []
    assert autopilot.telemetry.state_at(BootNs(8_500 * MS)).position_ned is None
