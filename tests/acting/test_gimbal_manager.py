"""The dialogue with a gimbal manager, message by message."""

from math import isnan, nan, radians

import msgspec
import pytest
from acting_world import AUTOPILOT, CONFIGURE, REQUEST, T0, S, message

from fwav_companion.acting.aim import Angles
from fwav_companion.acting.gimbal_manager import Control, GimbalManager

OURS, NOBODY, OTHER = (1, 191), (0, 0), (255, 190)
LIMITS = {"pitch_min": radians(-90), "pitch_max": radians(30), "yaw_min": radians(-170), "yaw_max": radians(170)}


def status(primary, device=1, sender=(1, 1), link="fc", flags=12):
    return message(
        "GIMBAL_MANAGER_STATUS",
        sender,
        link,
        gimbal_device_id=device,
        flags=flags,
        primary_control_sysid=primary[0],
        primary_control_compid=primary[1],
    )


def information(device=1, sender=(1, 1), link="fc", **changes):
    return message("GIMBAL_MANAGER_INFORMATION", sender, link, gimbal_device_id=device, **{**LIMITS, **changes})


def numbers(sent):
    return [each.fields["command"] for each in sent]


def taking(device=1):
    manager = GimbalManager(device, 191)
    manager.begin(T0)
    assert numbers(manager.on_wake(T0, AUTOPILOT)) == [REQUEST, REQUEST]
    manager.on_message(information(), AUTOPILOT)
    manager.on_message(status(NOBODY), AUTOPILOT)
    return manager, manager.on_wake(T0 + S, AUTOPILOT)


def held():
    manager, _ = taking()
    manager.on_message(status(OURS), AUTOPILOT)
    assert manager.control is Control.OURS
    return manager


def test_control_is_asked_for_with_our_real_ids():
    _, (configure, request) = taking()
    assert configure.fields["command"] == CONFIGURE
    assert [configure.fields[f"param{index}"] for index in (1, 2, 3, 4, 7)] == [1.0, 191.0, -1.0, -1.0, 1.0]
    assert request.fields["param1"] == 281.0
    assert (configure.link, configure.component) == ("fc", 191)


def test_nothing_is_commanded_before_the_status_names_us():
    manager, _ = taking()
    assert manager.point(Angles(-0.5, 0.1)) is None
    manager.on_message(message("COMMAND_ACK", command=CONFIGURE, result=0), AUTOPILOT)
    assert manager.point(Angles(-0.5, 0.1)) is None
    manager.on_message(status(OURS), AUTOPILOT)
    sent = manager.point(Angles(-0.5, 0.1))
    assert (sent.name, sent.fields["pitch"], sent.fields["yaw"]) == ("GIMBAL_MANAGER_SET_PITCHYAW", -0.5, 0.1)
    assert isnan(sent.fields["pitch_rate"])
    assert isnan(sent.fields["yaw_rate"])
    assert sent.fields["flags"] == 4 + 8 + 32


def test_control_of_another_is_not_taken():
    manager = GimbalManager(1, 191)
    manager.begin(T0)
    manager.on_message(status(OTHER), AUTOPILOT)
    assert manager.on_wake(T0, AUTOPILOT) == []
    assert manager.refusal == "the gimbal is held by 255/190: release it there"


def test_control_that_another_takes_is_not_fought_for():
    manager = held()
    manager.on_message(status(OTHER), AUTOPILOT)
    assert manager.taken_by == OTHER
    assert manager.point(Angles(0.0, 0.0)) is None
    assert [manager.on_wake(T0 + k * S, AUTOPILOT) for k in range(2, 9)] == [[]] * 7
    assert manager.end(AUTOPILOT) == []


@pytest.mark.parametrize(
    ("flags", "mode"),
    [
        ((12, 12 + 1), "retracted"),
        ((12, 12 + 2), "neutral"),
        ((12, 12 + 256), "the sticks alone"),
        ((12 + 2, 12, 12 + 2), "neutral"),  # the mode before our first command, and once more
        ((12 + 2, 12 + 2), None),  # it was neutral when we took it
        ((12 + 2, 12), None),
        ((12, 12 + 16, 12 + 32), None),
    ],
)
def test_mode_that_somebody_else_gives_the_manager_is_noticed(flags, mode):
    manager, _ = taking()
    for each in flags:
        manager.on_message(status(OURS, flags=each), AUTOPILOT)
    assert manager.new_mode == mode
    manager.begin(T0)
    assert manager.new_mode is None


def test_control_is_given_back_where_we_have_it():
    (released,) = held().end(AUTOPILOT)
    assert [released.fields[f"param{index}"] for index in (1, 2)] == [0.0, 0.0]
    assert GimbalManager(1, 191).end(AUTOPILOT) == []


@pytest.mark.parametrize(
    ("result", "word"), [(2, "denied"), (3, "unsupported"), (4, "failed"), (1, "temporarily rejected")]
)
def test_refusal_of_the_manager_is_named(result, word):
    manager, _ = taking()
    manager.on_message(message("COMMAND_ACK", command=CONFIGURE, result=result), AUTOPILOT)
    assert manager.refusal == f"the gimbal's manager answers: {word}"


def test_silent_manager_is_asked_five_times():
    manager = GimbalManager(1, 191)
    manager.begin(T0)
    sent = [manager.on_wake(T0 + k * S, AUTOPILOT) for k in range(8)]
    assert sum(map(bool, sent)) == 5
    assert manager.refusal == "no gimbal manager answers"


def test_manager_that_never_names_us_is_given_up():
    manager, _ = taking()
    for k in range(2, 9):
        manager.on_wake(T0 + k * S, AUTOPILOT)
        manager.on_message(status(NOBODY), AUTOPILOT)
    assert manager.refusal == "the gimbal's manager does not give the control"


@pytest.mark.parametrize(
    ("device", "heard", "chosen"),
    [
        (1, [status(NOBODY, 1), status(NOBODY, 2)], (1, 1)),
        (2, [status(NOBODY, 1), status(NOBODY, 2)], (1, 2)),
        (154, [status(NOBODY, 0, (1, 154), "gimbal")], (154, 0)),
        (154, [status(NOBODY, 1)], (1, 1)),  # ArduPilot numbers a MAVLink gimbal, too
        (154, [status(NOBODY, 1), status(NOBODY, 2)], None),
    ],
)
def test_manager_of_the_configured_gimbal_is_chosen(device, heard, chosen):
    manager = GimbalManager(device, 191)
    manager.begin(T0)
    for each in heard:
        manager.on_message(each, AUTOPILOT)
    manager.on_wake(T0, AUTOPILOT)
    found = manager.manager
    assert (None if found is None else (found.component, found.device_id)) == chosen


@pytest.mark.parametrize("broken", [nan, radians(-180)])
def test_limits_that_are_no_range_are_not_believed(broken):
    manager, _ = taking()
    assert manager.manager.limits == (Angles(radians(-90), radians(-170)), Angles(radians(30), radians(170)))
    manager.on_message(information(pitch_max=broken), AUTOPILOT)
    assert manager.manager.limits is None


def test_messages_of_another_vehicle_are_ignored():
    manager = GimbalManager(1, 191)
    manager.begin(T0)
    manager.on_message(status(NOBODY, sender=(2, 1)), AUTOPILOT)
    assert manager.primary is None


def fakes(count, device=1):
    return [status(OURS, device, (1, 200 + k), "payload") for k in range(count)]


def test_control_that_is_taken_is_seen_although_another_component_claims_the_gimbal():
    manager = held()
    for each in [*fakes(3), status(OTHER)]:
        manager.on_message(each, AUTOPILOT)
    assert (manager.control, manager.taken_by) == (Control.NONE, OTHER)
    assert manager.point(Angles(0.0, 0.0)) is None


def test_claim_of_another_component_takes_no_control_away():
    manager = held()
    for each in fakes(9):
        manager.on_message(each, AUTOPILOT)
    manager.on_message(status(OTHER, sender=(1, 200), link="payload"), AUTOPILOT)
    assert manager.control is Control.OURS
    assert manager.point(Angles(0.0, 0.0)).link == "fc"


def test_manager_of_the_autopilot_is_known_although_others_invent_managers():
    manager = GimbalManager(1, 191)
    manager.begin(T0)
    for each in [*fakes(9, device=7), *fakes(9)]:
        manager.on_message(each, AUTOPILOT)
    manager.on_message(information(), AUTOPILOT)
    assert numbers(manager.on_wake(T0, AUTOPILOT)) == [REQUEST, REQUEST], "its own status is awaited"
    manager.on_message(status(NOBODY), AUTOPILOT)
    assert numbers(manager.on_wake(T0 + S, AUTOPILOT)) == [CONFIGURE, REQUEST]
    assert (manager.manager.component, manager.manager.link) == (1, "fc")


def test_selections_again_and_again_ask_once_a_second():
    manager, sent = GimbalManager(1, 191), []
    for k in range(50):
        manager.end(AUTOPILOT)
        manager.begin(T0 + k * S // 10)
        sent += manager.on_wake(T0 + k * S // 10, AUTOPILOT)
    assert len(sent) == 2 * 5


def test_managers_of_a_former_vehicle_are_forgotten():
    manager = held()
    manager.end(AUTOPILOT)
    other = msgspec.structs.replace(AUTOPILOT, system=2)
    manager.begin(T0)
    manager.on_message(status(NOBODY, sender=(2, 1)), other)
    manager.on_wake(T0 + 2 * S, other)
    assert manager.manager.system == 2
