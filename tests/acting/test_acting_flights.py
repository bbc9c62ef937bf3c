"""Whole flights in the mock: what an operator's click has sent to the autopilot, and what ends it.

The mock has a gimbal manager, a region of interest and a follow mode of its own, made from the specifications.
"""

from math import dist, isfinite, isnan

import pytest
from acting_flights import STOP, TRACK_RECTANGLE, Operator, fly_acting

from fwav_companion.types import NoticeCode

CLICK_S = 8.0
CLICKED = Operator(commands=((CLICK_S, TRACK_RECTANGLE),))
GIMBAL, ROI, FOLLOW = ['point="gimbal"'], ['point="roi"'], ["follow_target=true", "follow_max_sigma_m=10.0"]
COMMANDING = ("GIMBAL_MANAGER_SET_PITCHYAW", "FOLLOW_TARGET", "COMMAND_INT")
CONFIGURE, ROI_LOCATION, ROI_NONE = 1001, 195, 197
ALLOWED = {CONFIGURE, ROI_LOCATION, ROI_NONE, 510, 511, 512}
"""Numbers of all commands that the service may send: of acting, of rates, and requests for messages."""
ENDED = (NoticeCode.ACT_ENDED, NoticeCode.ACT_REFUSED)


@pytest.mark.parametrize(
    ("act", "operator"),
    [
        ([], CLICKED),
        (['point="none"'], CLICKED),
        ([*GIMBAL, "follow_target=true"], Operator(commands=())),  # nothing was selected: `best` points at nothing
        (GIMBAL, Operator(commands=((CLICK_S, TRACK_RECTANGLE),), link="payload")),
    ],
)
def test_nothing_is_sent_without_a_configuration_and_a_selection_that_counts(act, operator):
    flight = fly_acting(act, operator, seconds=11.0)
    assert not flight.sent(*COMMANDING)
    assert not flight.commands(CONFIGURE)


@pytest.mark.slow
def test_gimbal_keeps_the_target_in_the_middle():
    flight = fly_acting(GIMBAL, CLICKED, seconds=20.0)
    assert flight.texts(NoticeCode.ACT_STARTED) == ["act: the gimbal points at person 1; STOP ends it"]
    assert flight.primary == (1, 191)
    assert flight.dropped == 0
    assert flight.share_within(0.03, CLICK_S + 4.0, 20.0) >= 0.95
    assert {each.fields["command"] for each in flight.sent("COMMAND_LONG", "COMMAND_INT")} <= ALLOWED


def test_stop_gives_the_gimbal_back_and_says_so():
    operator = Operator(commands=((CLICK_S, TRACK_RECTANGLE), (CLICK_S + 3.0, STOP)))
    flight = fly_acting(GIMBAL, operator, seconds=13.0)
    assert flight.primary == (0, 0)
    assert max(flight.times_s("GIMBAL_MANAGER_SET_PITCHYAW")) <= CLICK_S + 3.1
    assert flight.texts(*ENDED) == ["act: all ended, stopped by the operator"]


SILENT = Operator(commands=((CLICK_S, TRACK_RECTANGLE),), silent_from_s=9.0)
FREE, ANOTHER = (0, 0), (252, 190)


@pytest.mark.parametrize(
    ("differences", "operator", "latest_s", "text"),
    [
        ({"gimbal.taken_at_s": 11.0}, CLICKED, 11.2, "gimbal ended, another took the gimbal: 252/190"),
        ({"gimbal.manager_denies": True}, CLICKED, 0.0, "gimbal ended, refused: the gimbal's manager answers: denied"),
        ({"gimbal.manager": False}, CLICKED, 0.0, "gimbal ended, refused: no gimbal manager answers"),
        ({"gimbal.neutral_at_s": 11.0}, CLICKED, 11.2, "gimbal ended, the gimbal's mode changed: neutral"),
        ({"gimbal.stick_at_s": 11.5}, CLICKED, 14.0, "gimbal ended, the pilot moved the gimbal"),
        ({"gimbal.frozen": True}, CLICKED, 14.5, "gimbal ended, the gimbal does not follow: commanded 21 deg, moved 0"),
        ({"autopilot.disarms_at_s": 11.0}, CLICKED, 11.2, "all ended, disarmed"),
        (
            {"autopilot.status_changes_at_s": 11.0, "autopilot.status_then": 3},
            CLICKED,
            11.2,
            "all ended, landed",
        ),
        ({"autopilot.status_changes_at_s": 11.0}, CLICKED, 11.2, "all ended, failsafe"),
        ({"others.reboots_at_s": (11.0,)}, CLICKED, 14.5, "all ended, the autopilot rebooted"),
        ({"downlink.silences": ((9.0, 16.0),)}, CLICKED, 14.5, "all ended, the autopilot is silent"),
        ({}, SILENT, 13.2, "all ended, the selecting station is silent"),
    ],
)
def test_end_of_the_pointing_is_said_once_and_nothing_follows(differences, operator, latest_s, text):
    flight = fly_acting(GIMBAL, operator, seconds=16.0, **differences)
    assert flight.texts(*ENDED) == [f"act: {text}"]
    assert max(flight.times_s("GIMBAL_MANAGER_SET_PITCHYAW"), default=0.0) <= latest_s
    assert flight.primary == (ANOTHER if "gimbal.taken_at_s" in differences else FREE)


def test_attitude_without_a_number_gives_no_fix_and_no_command_without_one():
    flight = fly_acting(GIMBAL, CLICKED, seconds=16.0, **{"gimbal.nan_from_s": 11.0})
    sent = flight.sent("GIMBAL_MANAGER_SET_PITCHYAW")
    assert max(flight.times_s("GIMBAL_MANAGER_SET_PITCHYAW")) > 12.0
    assert all(isfinite(each.fields[name]) for each in sent for name in ("pitch", "yaw"))
    assert flight.companion.lines[-1].dropped["stale_gimbal"] > 60


def test_what_the_gimbal_can_do_is_asked_before_a_selection():
    """`check` reports it; nothing else is sent."""
    flight = fly_acting([*GIMBAL, "follow_target=true"], Operator(commands=()), seconds=11.0)
    acting = flight.companion.pipeline.status(flight.companion._now).acting
    assert acting.pitch_limits_deg == pytest.approx((-90.0, 30.0))
    assert acting.yaw_limits_deg == pytest.approx((-180.0, 180.0))
    assert {each.fields["param1"] for each in flight.commands(512)} >= {280.0, 281.0}
    assert sum(each.fields["param1"] == 280.0 for each in flight.commands(512)) <= 2


@pytest.mark.parametrize("firmware", ["ardupilot", "px4"])
def test_roi_is_where_the_target_is_and_stays_when_nothing_moves(firmware):
    flight = fly_acting(
        ROI,
        Operator(commands=((CLICK_S, TRACK_RECTANGLE), (CLICK_S + 3.0, STOP))),
        seconds=13.0,
        **{"autopilot.firmware": firmware},
    )
    sent = flight.commands(ROI_LOCATION)
    assert sent
    assert all(each.name == "COMMAND_INT" and each.fields["frame"] == 0 for each in sent)
    assert len(flight.commands(ROI_NONE)) == 1
    assert "nose may turn" in flight.texts(NoticeCode.ACT_STARTED)[0]
    *given, cleared = flight.roi
    assert cleared is None
    for _, place in given:
        assert place.alt_amsl == pytest.approx(flight.options.origin[2], abs=1.0)


def test_roi_that_the_autopilot_refuses_is_reported_once():
    flight = fly_acting(ROI, CLICKED, seconds=13.0, **{"autopilot.refuses_roi": True})
    assert flight.texts(*ENDED) == ["act: roi ended, refused: the autopilot answers: failed"]
    assert len(flight.commands(ROI_LOCATION)) <= 2


@pytest.mark.parametrize(("system", "refused"), [(17, None), (0, "the vehicle's own system")])
def test_follow_target_reaches_ardupilot_from_another_system_alone(system, refused):
    act = [*FOLLOW, f"follow_system_id={system}"]
    flight = fly_acting(act, CLICKED, seconds=12.0)
    if refused is not None:
        assert not flight.followed
        assert flight.follow_refused[refused] > 5
        return
    assert 8 <= len(flight.followed) <= 22  # five a second
    true = flight.options.targets[0]
    centre = flight.options.flight.centre
    for _, (north, east, _), velocity in flight.followed:
        assert dist((north, east), (centre[0] + true.north, centre[1] + true.east)) < 1.0
        assert all(map(isnan, velocity))  # a static target has no velocity
    assert {each.system for each in flight.sent("FOLLOW_TARGET")} == {17}
    assert not [each for each in flight.sent("HEARTBEAT") if each.system == 17]


def test_follow_target_rests_with_a_text_where_the_claim_is_too_wide():
    flight = fly_acting(["follow_target=true", "follow_max_sigma_m=0.05"], CLICKED, seconds=11.0)
    assert not flight.sent("FOLLOW_TARGET")
    assert flight.texts(NoticeCode.ACT_WITHHELD) == ["act: FOLLOW_TARGET rests, the target is too uncertain"]


@pytest.mark.parametrize(("to_component", "answers"), [(100, {100}), (191, {191}), (0, {100})])
def test_tracking_command_gets_one_answer_on_either_component(to_component, answers):
    flight = fly_acting(
        FOLLOW, Operator(commands=((CLICK_S, TRACK_RECTANGLE),), to_component=to_component), seconds=10.0
    )
    acknowledged = [each for each in flight.sent("COMMAND_ACK") if each.fields["command"] == TRACK_RECTANGLE]
    assert [each.component for each in acknowledged] == list(answers)
    assert [each.fields["result"] for each in acknowledged] == [0]
    assert flight.sent("FOLLOW_TARGET")
