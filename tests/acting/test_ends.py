"""What ends acting, through all of it: said once, the gimbal given back, and nothing sent after it."""

import pytest
from acting_world import (
    CONFIGURE,
    CRITICAL,
    OURS,
    ROI,
    ROI_NONE,
    STANDBY,
    STATION,
    T0,
    Acted,
    S,
    a_track,
    heartbeat,
    message,
)

from fwav_companion.acting.permission import End
from fwav_companion.types import NoticeCode

STEP = S // 20
BEGAN_S, AFTER_S = 3, 8
POINTS = ("gimbal", "roi", "none")
ENDS = (NoticeCode.ACT_ENDED, NoticeCode.ACT_REFUSED)
POINTING = ("GIMBAL_MANAGER_SET_PITCHYAW", "COMMAND_INT")
COMMANDING = (*POINTING, "FOLLOW_TARGET")


def moving(now):
    """It walks to the north: a region of interest is due each second."""
    return a_track(now, (20.0 + (now - T0) / S, 0.0, 0.0), ray=(0.0, 0.0, 1.0))


def flown(acted, from_s, seconds, *, track=moving, **how):
    for k in range(round(20 * from_s) + 1, round(20 * (from_s + seconds)) + 1):
        acted.step(T0 + k * STEP, track(T0 + k * STEP), **how)
    return T0 + round(20 * (from_s + seconds)) * STEP


def acting_on(point, *, follow_target=True):
    acted = Acted(point, follow_target=follow_target)
    acted.select(T0, (20.0, 0.0, 0.0))
    now = flown(acted, 0, BEGAN_S)
    expected = {"gimbal": "GIMBAL_MANAGER_SET_PITCHYAW", "roi": "COMMAND_INT", "none": "FOLLOW_TARGET"}[point]
    assert acted.count(expected)
    assert not ends(acted)
    return acted, now


def ends(acted):
    return [text for text, code in zip(acted.texts, acted.codes, strict=True) if code in ENDS]


def released(acted, since):
    return [(int(each.fields["param1"]), int(each.fields["param2"])) for each in acted.commands(CONFIGURE, since=since)]


def stop(acted, now):
    acted.acting.on_stopped(now)


def event(end):
    return lambda acted, now: acted.acting.on_end(end, now)


def heard(each):
    return lambda acted, now: acted.hear(each, now)


OF_THE_FLIGHT = [
    (stop, "stopped by the operator"),
    (heard(heartbeat(armed=False)), "disarmed"),
    (heard(heartbeat(status=STANDBY)), "landed"),
    (heard(message("EXTENDED_SYS_STATE", landed_state=1)), "landed"),
    (heard(heartbeat(status=CRITICAL)), "failsafe"),
    (event(End.REBOOTED), "the autopilot rebooted"),
    (event(End.REPLACED), "another autopilot"),
    (event(End.AUTOPILOT_LOST), "the autopilot is silent"),
]


@pytest.mark.parametrize("point", POINTS)
@pytest.mark.parametrize(("happens", "text"), OF_THE_FLIGHT, ids=[text for _, text in OF_THE_FLIGHT])
def test_end_of_the_flight_or_stop_ends_all_of_it(point, happens, text):
    acted, now = acting_on(point)
    happens(acted, now)
    flown(acted, BEGAN_S, AFTER_S)
    assert ends(acted) == [f"act: all ended, {text}"]
    assert not acted.acting.status().acts
    sent = [each for at, each in acted.sent if at > now and each.name in COMMANDING]
    cleared = point == "roi" and happens is stop
    assert [each.fields["command"] for each in sent] == ([ROI_NONE] if cleared else [])
    assert released(acted, now + 1) == ([(0, 0)] if point == "gimbal" else [])


@pytest.mark.parametrize("point", POINTS)
@pytest.mark.parametrize(
    ("track", "station", "text", "latest_s"),
    [
        (moving, False, "the selecting station is silent", 5.0),
        (lambda _now: None, True, "the target was lost", 0.1),
        (lambda _now: moving(T0 + BEGAN_S * S), True, "no pictures come", 5.1),
    ],
)
def test_silence_and_the_end_of_the_target_end_all_of_it(point, track, station, text, latest_s):
    acted, now = acting_on(point)
    flown(acted, BEGAN_S, AFTER_S, track=track, station=station)
    assert ends(acted) == [f"act: all ended, {text}"]
    last = max(at for at, each in acted.sent if each.name in COMMANDING)
    assert last <= now + latest_s * S
    assert not acted.commands(ROI_NONE)
    assert released(acted, now + 1) == ([(0, 0)] if point == "gimbal" else [])


def taken(acted, now):
    acted.be_primary(STATION, now)


def neutral(acted, now):
    acted.be_primary(OURS, now, flags=12 + 2)


def stick(acted, _now):
    acted.obeys, acted.look = False, (-30.0, 20.0)


def mode(acted, now):
    acted.hear(heartbeat(mode=23), now)


OF_THE_POINTING = [
    ("gimbal", taken, "another took the gimbal: 255/190", []),
    ("gimbal", neutral, "the gimbal's mode changed: neutral", [(0, 0)]),
    ("gimbal", stick, "the pilot moved the gimbal", [(0, 0)]),
    ("roi", mode, "the flight mode changed", []),
]


@pytest.mark.parametrize("follow_target", [True, False])
@pytest.mark.parametrize(
    ("point", "happens", "text", "given_back"), OF_THE_POINTING, ids=[text for _, _, text, _ in OF_THE_POINTING]
)
def test_who_takes_the_pointing_away_ends_it_and_leaves_follow(point, happens, text, given_back, follow_target):
    acted, now = acting_on(point, follow_target=follow_target)
    happens(acted, now)
    later = heartbeat(mode=23) if happens is mode else None
    end = flown(acted, BEGAN_S, AFTER_S, beat=later)
    assert ends(acted) == [f"act: {point} ended, {text}"]
    last = max(
        at for at, each in acted.sent if each.name == "GIMBAL_MANAGER_SET_PITCHYAW" or each.name == "COMMAND_INT"
    )
    assert last <= now + 2.2 * S
    assert not acted.commands(ROI, since=now + 1)
    assert released(acted, now + 1) == given_back
    assert acted.acting.status().acts is follow_target
    assert (acted.count("FOLLOW_TARGET", since=end - S) >= 4) is follow_target


def test_selection_after_an_end_begins_again():
    acted, now = acting_on("gimbal")
    stop(acted, now)
    flown(acted, BEGAN_S, 1)
    acted.select(now + S, (24.0, 0.0, 0.0))
    end = flown(acted, BEGAN_S + 1, 4)
    assert acted.looks_deg(end - S)
    assert acted.commands(CONFIGURE, since=end - 4 * S)[0].fields["param2"] == OURS[1]
