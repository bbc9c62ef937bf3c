"""Place and time of the origin, which never moves. The oracle of geodesy is pymap3d."""

from math import degrees

import pymap3d
import pytest
from telemetry_messages import Autopilot

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.telemetry import HomeMoved, OriginSet, RelativeWorld, TakeOffFound
from fwav_companion.types import TakeOff, TakeOffSource

LAT, LON = 473_977_420, 85_455_940


def kinds(autopilot: Autopilot, kind: type) -> list:
    return [event for event in autopilot.events if isinstance(event, kind)]


def test_the_first_position_is_the_origin_on_the_ground_of_take_off():
    autopilot = Autopilot()
    autopilot.send("GLOBAL_POSITION_INT", 100, alt=512_300, relative_alt=12_300)
    (reported,) = kinds(autopilot, OriginSet)
    assert not reported.late
    assert (reported.origin.lat_deg, reported.origin.lon_deg) == (pytest.approx(LAT * 1e-7), pytest.approx(LON * 1e-7))
    assert reported.origin.alt_amsl_m == pytest.approx(500.0)
    autopilot.send("GLOBAL_POSITION_INT", 200, lat=LAT + 5000)
    autopilot.send("GPS_GLOBAL_ORIGIN", 300)
    autopilot.send("GLOBAL_POSITION_INT", 400)
    assert len(kinds(autopilot, OriginSet)) == 1
    assert autopilot.telemetry.world.plane.origin == reported.origin


def test_an_origin_reported_before_is_taken_with_the_height_of_the_ground():
    autopilot = Autopilot()
    autopilot.send("GPS_GLOBAL_ORIGIN", 50, latitude=LAT - 1000, longitude=LON + 1000, altitude=123_000)
    autopilot.send("GLOBAL_POSITION_INT", 100)
    (reported,) = kinds(autopilot, OriginSet)
    assert reported.origin.lat_deg == pytest.approx((LAT - 1000) * 1e-7)
    assert reported.origin.alt_amsl_m == pytest.approx(490.0)


def test_no_fix_no_origin():
    autopilot = Autopilot()
    autopilot.send("GPS_RAW_INT", 50, fix_type=1)
    autopilot.send("GLOBAL_POSITION_INT", 100)
    autopilot.send("GLOBAL_POSITION_INT", 150, lat=0, lon=0)
    assert not kinds(autopilot, OriginSet)
    autopilot.send("GPS_RAW_INT", 200, fix_type=3)
    autopilot.send("GLOBAL_POSITION_INT", 250, lat=0, lon=0)
    assert not kinds(autopilot, OriginSet)
    autopilot.send("GLOBAL_POSITION_INT", 300)
    assert len(kinds(autopilot, OriginSet)) == 1


def test_positions_lie_where_pymap3d_puts_them():
    autopilot = Autopilot()
    autopilot.attitudes(0, 300)
    autopilot.send("GLOBAL_POSITION_INT", 100, alt=500_000, relative_alt=10_000)
    autopilot.send("GLOBAL_POSITION_INT", 200, lat=LAT + 20_000, lon=LON - 30_000, alt=530_000, relative_alt=40_000)
    position = autopilot.telemetry.state_at(BootNs(200_500_000)).position_ned
    origin = autopilot.telemetry.world.plane.origin
    north, east, _ = pymap3d.geodetic2ned(
        (LAT + 20_000) * 1e-7, (LON - 30_000) * 1e-7, 490.0, degrees(origin.lat), degrees(origin.lon), 490.0
    )
    assert position == pytest.approx((north, east, -40.0), abs=2e-4)


def test_without_a_position_the_world_becomes_relative_ten_seconds_after_the_first_attitude():
    autopilot = Autopilot()
    assert autopilot.telemetry.world.relative is None
    assert autopilot.telemetry.wake_at is None
    autopilot.send("ATTITUDE", 1000)
    assert autopilot.telemetry.wake_at == autopilot.host(11_000)
    assert autopilot.telemetry.on_wake(autopilot.host(10_999)) == ()
    assert autopilot.telemetry.world.relative is None
    assert autopilot.telemetry.on_wake(autopilot.host(11_000)) == (RelativeWorld(),)
    assert autopilot.telemetry.world.relative is True
    assert autopilot.telemetry.wake_at is None


def test_a_position_after_all_is_reported_as_late():
    autopilot = Autopilot()
    autopilot.attitudes(1000, 12_000, 100)
    assert kinds(autopilot, RelativeWorld) == [RelativeWorld()]
    autopilot.send("GLOBAL_POSITION_INT", 20_000)
    assert [event.late for event in kinds(autopilot, OriginSet)] == [True]
    assert autopilot.telemetry.world.relative is False


def test_position_none_never_has_an_origin():
    autopilot = Autopilot(position="none")
    assert autopilot.telemetry.world.relative is True
    autopilot.attitudes(0, 300)
    autopilot.send("GLOBAL_POSITION_INT", 200)
    assert autopilot.events == []
    state = autopilot.telemetry.state_at(BootNs(205_000_000))
    assert state.position_ned is None
    assert state.height_above_home_m == pytest.approx(10.0)


def test_home_moves_only_the_home_surface():
    autopilot = Autopilot()
    autopilot.send("HOME_POSITION", 50, altitude=490_000)
    autopilot.send("GLOBAL_POSITION_INT", 100)
    assert kinds(autopilot, HomeMoved) == []
    autopilot.send("HOME_POSITION", 200, altitude=490_800)
    assert [event.down_m for event in kinds(autopilot, HomeMoved)] == [pytest.approx(-0.8)]
    assert autopilot.telemetry.world.home_down_m == pytest.approx(-0.8)
    autopilot.send("HOME_POSITION", 300, altitude=490_800)
    assert len(kinds(autopilot, HomeMoved)) == 1
    assert autopilot.telemetry.world.plane.origin.alt_amsl_m == pytest.approx(490.0)


def test_the_take_off_is_the_first_reported_home_and_until_then_the_origin():
    autopilot = Autopilot()
    autopilot.send("GLOBAL_POSITION_INT", 100, lat=LAT + 5000)
    world = autopilot.telemetry.world
    assert world.take_off == TakeOff(world.plane.origin, TakeOffSource.ASSUMED)
    autopilot.send("HOME_POSITION", 200, latitude=LAT, longitude=LON, altitude=490_000)
    (found,) = kinds(autopilot, TakeOffFound)
    assert world.take_off.place == found.place
    assert (found.place.lat_deg, found.place.alt_amsl_m) == (pytest.approx(LAT * 1e-7), pytest.approx(490.0))
    autopilot.send("HOME_POSITION", 300, latitude=LAT - 9000, altitude=480_000)
    assert world.take_off.place == found.place, "a home that is moved in flight is not where the vehicle took off"


ARMED, DISARMED = 128, 0


def test_a_vehicle_that_is_first_heard_in_the_air_shows_no_take_off():
    autopilot = Autopilot()
    autopilot.send("HEARTBEAT", 50, base_mode=ARMED)
    for boot_ms in (100, 200, 300):
        autopilot.send("GLOBAL_POSITION_INT", boot_ms, alt=560_000, relative_alt=60_000)
    autopilot.send("HEARTBEAT", 350, base_mode=ARMED)
    assert autopilot.telemetry.world.take_off.source is TakeOffSource.ASSUMED
    assert kinds(autopilot, TakeOffFound) == []


@pytest.mark.parametrize(("speed_cm_s", "source"), [(0, TakeOffSource.STANDING), (300, TakeOffSource.ASSUMED)])
def test_a_disarmed_vehicle_at_rest_stands(speed_cm_s, source):
    autopilot = Autopilot()
    autopilot.send("HEARTBEAT", 50, base_mode=DISARMED)
    autopilot.send("GLOBAL_POSITION_INT", 100, alt=512_000, relative_alt=3_000, vx=speed_cm_s)
    take_off = autopilot.telemetry.world.take_off
    assert take_off.source is source
    assert take_off.place.alt_amsl_m == pytest.approx(512.0 if source is TakeOffSource.STANDING else 509.0)


def test_arming_shows_the_take_off_and_home_position_better():
    autopilot = Autopilot()
    autopilot.send("HEARTBEAT", 50, base_mode=DISARMED)
    autopilot.send("GLOBAL_POSITION_INT", 100, alt=512_000, relative_alt=0)
    autopilot.send("GLOBAL_POSITION_INT", 200, alt=512_500, relative_alt=0)
    autopilot.send("HEARTBEAT", 250, base_mode=ARMED)
    assert autopilot.telemetry.world.take_off.source is TakeOffSource.ARMING
    assert autopilot.telemetry.world.take_off.place.alt_amsl_m == pytest.approx(512.5)
    autopilot.send("GLOBAL_POSITION_INT", 300, alt=560_000, relative_alt=48_000)
    autopilot.send("HOME_POSITION", 400, latitude=LAT, longitude=LON, altitude=511_900)
    assert autopilot.telemetry.world.take_off.source is TakeOffSource.HOME_POSITION
    assert autopilot.telemetry.world.take_off.place.alt_amsl_m == pytest.approx(511.9)


@pytest.mark.parametrize("down_m", [60.0, 1.0])
def test_a_vehicle_that_came_down_and_is_disarmed_shows_where_it_landed(down_m):
    """First heard 60 m up, or on a bench, where a metre of drift is not a flight."""
    autopilot = Autopilot()
    world = autopilot.telemetry.world
    autopilot.send("HEARTBEAT", 50, base_mode=ARMED)
    for step in range(4):
        height_m = down_m * (1.0 - step / 3.0)
        autopilot.send(
            "GLOBAL_POSITION_INT", 100 + step, alt=round(1e3 * (507.0 + height_m)), relative_alt=round(1e3 * height_m)
        )
    autopilot.send("HEARTBEAT", 350, base_mode=DISARMED)
    assert world.take_off.source is (TakeOffSource.LANDING if down_m > 2.0 else TakeOffSource.STANDING)
    assert world.take_off.place.alt_amsl_m == pytest.approx(507.0)


def test_a_landing_is_not_where_the_vehicle_still_moves_and_yields_to_home_position():
    autopilot = Autopilot()
    world = autopilot.telemetry.world
    autopilot.send("HEARTBEAT", 50, base_mode=ARMED)
    autopilot.send("GLOBAL_POSITION_INT", 100, alt=560_000, relative_alt=60_000)
    autopilot.send("GLOBAL_POSITION_INT", 200, alt=530_000, relative_alt=30_000, vx=500)
    autopilot.send("HEARTBEAT", 250, base_mode=DISARMED)
    assert world.take_off.source is TakeOffSource.ASSUMED, "disarmed in the air, at 5 m/s"
    autopilot.send("GLOBAL_POSITION_INT", 300, alt=507_000, relative_alt=7_000)
    assert world.take_off.source is TakeOffSource.LANDING
    autopilot.send("HOME_POSITION", 400, latitude=LAT, longitude=LON, altitude=506_000)
    assert world.take_off.source is TakeOffSource.HOME_POSITION


def test_a_home_reported_before_the_origin_is_known_from_its_start():
    autopilot = Autopilot()
    autopilot.send("HOME_POSITION", 50, latitude=LAT, altitude=490_000)
    autopilot.send("GLOBAL_POSITION_INT", 100, lat=LAT + 5000)
    assert autopilot.telemetry.world.take_off.place.lat_deg == pytest.approx(LAT * 1e-7)
    assert kinds(autopilot, TakeOffFound) == []
