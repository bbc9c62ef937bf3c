"""Where the gimbal has to look, and that it is not moved for nothing."""

from itertools import pairwise
from math import atan2, cos, degrees, radians

import pytest
from acting_world import T0, S, a_track, options, situation, state

from fwav_companion.acting.aim import Angles, angle_between
from fwav_companion.acting.gimbal_watch import GimbalWatch
from fwav_companion.acting.pointing import Pointing

AHEAD = (0.0, 0.0, 1.0)
STEP = S // 20


def pointing(**changes):
    made = Pointing(options(**changes))
    made.start(Angles(radians(-45.0), 0.0), T0)
    return made


def commanded(made, track, seconds, *, vehicle=state, ray=AHEAD):
    """The commands of some seconds; the target's frames come with the commands."""
    found = []
    for k in range(1, round(20 * seconds) + 1):
        now = T0 + k * STEP
        made.on_track(track(now, ray))
        found.append(made.command(situation(now, vehicle(now))))
    return found


@pytest.mark.parametrize(
    ("target", "heading", "pitch_deg", "yaw_deg"),
    [
        ((20.0, 0.0, 0.0), 0.0, -45.0, 0.0),
        ((0.0, 20.0, 0.0), 0.0, -45.0, 90.0),
        ((0.0, 20.0, 0.0), 60.0, -45.0, 30.0),
        ((-30.0, 1.0, 0.0), 0.0, -33.7, 178.1),  # behind the vehicle
        ((0.5, 0.0, 0.0), 0.0, -88.6, 0.0),
    ],
)
def test_gimbal_ends_where_the_target_is(target, heading, pitch_deg, yaw_deg):
    made = pointing()
    last = commanded(
        made, lambda now, ray: a_track(now, target, ray=ray), 8.0, vehicle=lambda now: state(now, heading=heading)
    )[-1]
    assert degrees(last.pitch) == pytest.approx(pitch_deg, abs=0.6)
    assert (degrees(last.yaw) - yaw_deg + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=0.6)


def test_turn_is_no_faster_than_configured():
    found = commanded(pointing(point_rate_deg_s=10.0), lambda now, ray: a_track(now, (0.0, 20.0, 0.0), ray=ray), 4.0)
    steps = [degrees(abs(after.yaw - before.yaw)) for before, after in pairwise(found)]
    assert max(steps) == pytest.approx(0.5)
    assert sum(steps) == pytest.approx(40.0, rel=0.05)


def test_error_within_the_dead_band_moves_nothing():
    made = pointing()
    found = commanded(made, lambda now, ray: a_track(now, (20.1, 0.05, 0.0), ray=ray), 3.0)
    assert set(found[20:]) == {found[20]}


@pytest.mark.parametrize("ray", [(0.15, 0.0, 1.0), (-0.1, 0.0, 1.0), (0.0, 0.12, 1.0)])
def test_target_beside_the_middle_turns_the_gimbal_towards_it(ray):
    made = pointing()
    last = commanded(made, lambda now, ray: a_track(now, ray=ray), 1.0, ray=ray)[-1]
    if ray[0]:
        assert last.yaw * ray[0] > 0.0
        assert abs(last.yaw) > radians(2.0)
    else:
        assert last.pitch < radians(-47.0)


def test_limits_are_kept_and_noticed():
    made = pointing()
    made.limits = (Angles(radians(-90.0), radians(-60.0)), Angles(0.0, radians(60.0)))
    last = commanded(made, lambda now, ray: a_track(now, (-20.0, 5.0, 0.0), ray=ray), 6.0)[-1]
    assert degrees(last.yaw) == pytest.approx(60.0, abs=0.8)  # the dead band of 0.34 deg at a pitch of -60 deg
    assert made.at_limit


def test_jump_between_two_things_is_held_until_it_stays():
    made = pointing()
    there, elsewhere = (20.0, 0.0, 0.0), (20.0, 12.0, 0.0)
    for k in range(1, 81):  # half a second here, half a second there
        now = T0 + k * STEP
        made.on_track(a_track(now, there if k // 10 % 2 == 0 else elsewhere, ray=AHEAD))
        last = made.command(situation(now))
    assert made.holds or degrees(abs(last.yaw)) < 1.0
    assert degrees(abs(last.yaw)) < 1.0
    for k in range(81, 221):
        now = T0 + k * STEP
        made.on_track(a_track(now, elsewhere, ray=AHEAD))
        last = made.command(situation(now))
    assert not made.holds
    assert degrees(last.yaw) == pytest.approx(degrees(atan2(12.0, 20.0)), abs=1.0)


def test_estimate_that_moves_within_its_claim_leaves_the_target_in_the_middle():
    """A static estimate moves by 2 m, 4 deg as the axis turns, while the picture shows the target where it was.

    The picture turns the error away with a time constant of 0.5 s. The place has the same one, so that of a step of the
    place at most the share 1/e is left, 1.5 deg.
    """
    made, middle = pointing(), Angles(radians(-45.0), 0.0)
    look, errors = middle, []
    for k in range(1, 161):
        now = T0 + k * STEP
        off_right, off_down = (middle.yaw - look.yaw) * cos(look.pitch), look.pitch - middle.pitch
        place = (20.0, 0.0, 0.0) if k <= 80 else (20.0, 2.0, 0.0)
        made.on_track(a_track(now, place, ray=(off_right, off_down, 1.0)))
        look = made.command(situation(now))
        errors.append(degrees(angle_between(look, middle)))
    assert not made.holds
    assert max(errors[:80]) < 0.4
    assert 1.0 < max(errors[80:]) < 1.7
    assert errors[-1] < 0.4


def test_prediction_leads_a_vehicle_that_flies_past():
    """At 10 m/s past a target 20 m aside the direction turns by 0.5 rad/s: 0.08 s later it is 2.3 deg further."""

    def passing(now):
        along = 10.0 * (now - T0) / S
        return state(now, (along, 0.0, -20.0), (10.0, 0.0, 0.0))

    made = pointing(point_rate_deg_s=90.0)
    found = commanded(made, lambda now, ray: a_track(now, (20.0, 20.0, 0.0), ray=ray), 2.0, vehicle=passing, ray=AHEAD)
    now_s = 2.0 + 0.08
    assert degrees(found[-1].yaw) == pytest.approx(degrees(atan2(20.0, 20.0 - 10.0 * now_s)), abs=1.5)


def test_target_straight_below_turns_no_yaw():
    """Its bearing jumps from side to side by the noise of positions."""
    made = pointing()
    found = []
    for k in range(1, 101):
        now = T0 + k * STEP
        made.on_track(a_track(now, (0.05 if k % 4 < 2 else -0.05, 0.1 if k % 6 < 3 else -0.1, 0.0), ray=AHEAD))
        found.append(made.command(situation(now)))
    assert degrees(found[-1].pitch) == pytest.approx(-90.0, abs=1.0)
    assert {each.yaw for each in found} == {0.0}


def test_without_a_place_of_the_vehicle_the_last_command_stays():
    made = pointing()
    before = commanded(made, lambda now, ray: a_track(now, ray=ray), 1.0)[-1]
    now = T0 + 2 * S
    assert made.command(situation(now, state(now, None))) == before


@pytest.mark.parametrize(
    ("look_deg", "at_limit", "stick"),
    [(0.5, False, False), (8.0, False, True), (8.0, True, False), (2.5, False, False)],
)
def test_gimbal_that_leaves_a_steady_command_is_the_pilots(look_deg, at_limit, stick):
    watch, command = GimbalWatch(), Angles(0.0, 0.2)
    for k in range(100):
        off = radians(look_deg) if k > 40 else 0.0
        watch.on_command(command, Angles(0.0, 0.2 + off), T0 + k * STEP, at_limit=at_limit)
    assert watch.by_stick(T0 + 99 * STEP) is stick


@pytest.mark.parametrize("slowly_deg", [15.0, 0.75, -0.75])
def test_stick_is_noticed_while_the_command_moves(slowly_deg):
    """The command goes on with the target by 2 deg/s. ``slowly_deg``: the stick's way in each twentieth of a second."""
    watch = GimbalWatch()
    for k in range(100):
        yaw = radians(0.1 * k)
        off = radians(max(-15.0, min(15.0, -slowly_deg * max(0, k - 40))))
        watch.on_command(Angles(0.0, yaw), Angles(0.0, yaw + off), T0 + k * STEP, at_limit=False)
    assert watch.by_stick(T0 + 99 * STEP)


def test_gimbal_that_stops_at_an_unknown_limit_is_not_the_pilots():
    """PX4 reports limits of 90 and 180 deg, whatever the gimbal."""
    watch = GimbalWatch()
    for k in range(200):
        yaw = radians(min(25.0, 0.5 * k))
        watch.on_command(Angles(0.0, yaw), Angles(0.0, min(yaw, radians(12.5))), T0 + k * STEP, at_limit=False)
        assert not watch.by_stick(T0 + k * STEP)
    assert watch.stuck(Angles(0.0, radians(25.0)), T0 + 199 * STEP) is not None


def test_error_of_a_gimbal_that_left_its_command_is_not_turned_away():
    """Else the command would run from a stick, and be no command that the gimbal left."""
    made = pointing()
    made.trims = False
    assert set(commanded(made, lambda now, ray: a_track(now, ray=ray), 2.0, ray=(0.2, 0.1, 1.0))) == {
        Angles(radians(-45.0), 0.0)
    }


def test_gimbal_that_lags_behind_a_moving_command_is_not_the_pilots():
    watch = GimbalWatch()
    for k in range(100):
        yaw = radians(0.2 * k)
        watch.on_command(Angles(0.0, yaw), Angles(0.0, yaw - radians(min(4.0, 0.2 * k))), T0 + k * STEP, at_limit=False)
    assert not watch.by_stick(T0 + 99 * STEP)


@pytest.mark.parametrize(("moves", "said"), [(False, "commanded 20 deg, moved 0"), (True, None)])
def test_gimbal_that_never_moves_is_reported_with_numbers(moves, said):
    watch = GimbalWatch()
    for k in range(100):
        yaw = radians(min(20.0, k * 1.5))
        watch.on_command(Angles(0.0, yaw), Angles(0.0, yaw if moves else 0.0), T0 + k * STEP, at_limit=False)
    assert watch.stuck(Angles(0.0, radians(20.0)), T0 + 99 * STEP) == said
    assert not watch.by_stick(T0 + 99 * STEP)
