"""What goes wrong on the other side, through all of acting: a gimbal, a target or another program that misbehaves."""

from itertools import pairwise
from math import isfinite, radians, tan

import pytest
from acting_world import CONFIGURE, OURS, ROI, STATION, T0, Acted, S, a_track

from fwav_companion.types import NoticeCode

STEP = S // 20
AHEAD = (0.0, 0.0, 1.0)
ENDS = (NoticeCode.ACT_ENDED, NoticeCode.ACT_REFUSED)


def flown(acted, seconds, place, *, from_s=0.0, ray=AHEAD):
    """Fly on with a frame at each step. ``place``: the target by the time, 20 m below the vehicle."""
    first = round(20 * from_s) + 1
    for k in range(first, first + round(20 * seconds)):
        now = T0 + k * STEP
        acted.step(now, a_track(now, place(k / 20.0), ray=ray))
    return T0 + (first - 1 + round(20 * seconds)) * STEP


def still(north, east, down=0.0):
    return lambda _t_s: (north, east, down)


def ends(acted):
    return [text for text, code in zip(acted.texts, acted.codes, strict=True) if code in ENDS]


def begun(place, **changes):
    acted = Acted("gimbal", **changes)
    acted.select(T0, place(0.0))
    return acted


def test_limit_of_the_gimbal_is_kept_and_said_once():
    place = still(10.0, 20.0)  # 63 deg to the right
    acted = begun(place, limits_deg=(-30.0, 30.0))
    flown(acted, 12.0, place, ray=(tan(radians(33.0)), 0.0, 1.0))
    assert max(yaw for _, yaw in acted.looks_deg()) == pytest.approx(30.0, abs=0.5)
    assert acted.texts.count("act: the gimbal is at its limit") == 1
    assert not ends(acted)
    assert acted.looks_deg(T0 + 11 * S)


def test_gimbal_without_a_yaw_axis_is_at_its_limit_and_is_not_turned():
    place = still(10.0, 20.0)
    acted = begun(place, limits_deg=(0.0, 0.0))
    flown(acted, 6.0, place, ray=(tan(radians(63.0)), 0.0, 1.0))
    assert {yaw for _, yaw in acted.looks_deg()} == {0.0}
    assert not ends(acted)


def test_gimbal_that_never_moves_is_reported_and_given_back_and_follow_goes_on():
    place = still(20.0, 20.0)  # 45 deg to the right
    acted = begun(place, follow_target=True)
    acted.obeys = False
    end = flown(acted, 8.0, place, ray=(1.0, 0.0, 1.0))
    (text,) = ends(acted)
    assert text.startswith("act: gimbal ended, the gimbal does not follow: commanded ")
    assert text.endswith(" deg, moved 0")
    (*_, released) = acted.commands(CONFIGURE)
    assert (released.fields["param1"], released.fields["param2"]) == (0.0, 0.0)
    assert not acted.looks_deg(end - S)
    assert acted.count("FOLLOW_TARGET", since=end - S) >= 4


def behind(t_s):
    """It crosses the line behind the vehicle to and fro, 3 deg to each side."""
    return -20.0, 1.0 if t_s % 4.0 < 2.0 else -1.0, 0.0


@pytest.mark.parametrize("limits_deg", [None, (-180.0, 180.0)])
def test_target_that_crosses_the_rear_turns_the_gimbal_through_no_front(limits_deg):
    acted = begun(behind, limits_deg=limits_deg)
    after = flown(acted, 8.0, behind)
    flown(acted, 12.0, behind, from_s=8.0)
    yaws = [yaw for _, yaw in acted.looks_deg(after)]
    assert min(map(abs, yaws)) > 170.0
    if limits_deg is not None:
        assert max(abs(b - a) for a, b in pairwise(yaws)) < 2.0  # past a stop, the command does not change its sign
    assert not ends(acted)


def test_target_that_stays_on_the_other_side_of_the_rear_is_reached_through_the_front():
    acted = begun(still(-20.0, 1.0), limits_deg=(-180.0, 180.0))
    after = flown(acted, 8.0, still(-20.0, 1.0))
    assert acted.looks_deg()[-1][1] == pytest.approx(177.0, abs=1.0)
    flown(acted, 20.0, still(-20.0, -12.0), from_s=8.0)
    yaws = [yaw for _, yaw in acted.looks_deg(after)]
    assert yaws[-1] == pytest.approx(-149.0, abs=1.0)
    assert max(abs(b - a) for a, b in pairwise(yaws)) <= 1.51


def test_target_behind_a_gimbal_that_looks_ahead_alone_leaves_it_at_its_limit():
    acted = begun(behind, limits_deg=(-30.0, 30.0))
    flown(acted, 10.0, behind, ray=(0.5, 0.0, 1.0))
    yaws = [yaw for _, yaw in acted.looks_deg()]
    assert max(map(abs, yaws)) <= 30.0 + 1e-9
    assert {round(yaw) for yaw in yaws[100:]} in ({30}, {-30})
    assert acted.texts.count("act: the gimbal is at its limit") == 1
    assert not ends(acted)


def test_track_that_jumps_between_two_things_is_held_with_a_text_until_it_stays():
    acted = begun(still(20.0, 0.0))
    flown(acted, 4.0, still(20.0, 0.0))
    end = flown(acted, 6.0, lambda t_s: (20.0, 12.0 if t_s % 1.0 < 0.5 else 0.0, 0.0), from_s=4.0)
    assert max(abs(yaw) for _, yaw in acted.looks_deg()) < 1.0
    assert "act: the target jumped, the gimbal holds" in acted.texts
    flown(acted, 8.0, still(20.0, 12.0), from_s=10.0)
    assert acted.looks_deg(end)[-1][1] == pytest.approx(31.0, abs=1.0)
    assert not ends(acted)


def test_gimbal_that_reports_no_attitude_is_commanded_by_the_track_in_finite_angles():
    """What the telemetry makes of an attitude that is not finite: none."""
    place = still(20.0, 10.0)
    acted = begun(place)
    acted.obeys, acted.look = False, None
    flown(acted, 6.0, place, ray=None)
    looks = acted.looks_deg()
    assert all(isfinite(angle) for look in looks for angle in look)
    assert looks[-1][1] == pytest.approx(26.6, abs=2.0)
    assert not ends(acted)


@pytest.mark.parametrize(
    ("place", "why"),
    [
        ((20.0, 0.0, -30.0), "the target is above the vehicle"),
        ((5001.0, 0.0, 0.0), "the target is beyond 5 km"),
    ],
)
def test_region_of_interest_that_cannot_be_is_not_sent_and_the_text_says_why(place, why):
    acted = Acted("roi")
    acted.select(T0, place)
    flown(acted, 5.0, still(*place))
    assert not acted.commands(ROI)
    assert acted.texts == [f"act: no ROI is sent, {why}"]
    end = flown(acted, 2.0, still(20.0, 0.0), from_s=5.0)
    assert acted.commands(ROI, since=end - 2 * S)


def test_two_managers_that_fight_are_left_alone():
    """Another station and we are named in turn; nothing is sent after the first loss, not even the release."""
    place = still(20.0, 0.0)
    acted = begun(place, limits_deg=(-180.0, 180.0))
    lost = flown(acted, 3.0, place)
    for k in range(10):
        acted.be_primary(STATION if k % 2 == 0 else OURS, lost)
        lost_since = flown(acted, 0.5, place, from_s=3.0 + 0.5 * k)
    assert ends(acted) == ["act: gimbal ended, another took the gimbal: 255/190"]
    assert lost_since > lost
    assert [each for now, each in acted.sent if now > lost] == []
