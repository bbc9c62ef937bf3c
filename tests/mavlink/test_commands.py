"""Every command is answered once, by the component that it addresses."""

from collections import namedtuple
from math import inf, nan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from fwav_companion.mavlink.client.commands import Commands
from fwav_companion.types import (
    Autopilot,
    AutopilotKind,
    CommandAnswer,
    CommandResult,
    Destination,
    Message,
    Outgoing,
    Situation,
)

S = 10**9
T0 = 300 * S
Long = namedtuple(
    "Long",
    "target_system target_component command confirmation param1 param2 param3 param4 param5 param6 param7",
)
Int = namedtuple(
    "Int",
    "target_system target_component frame command current autocontinue param1 param2 param3 param4 x y z",
)
Ping = namedtuple("Ping", "time_usec seq target_system target_component")
HANDLED = 2004


class Handler:
    def __init__(self):
        self.seen = []

    def __call__(self, command, situation):
        self.seen.append(command)
        return CommandAnswer(CommandResult.ACCEPTED) if command.number == HANDLED else None


@pytest.fixture
def camera():
    return Handler()


@pytest.fixture
def commands(camera):
    return Commands({191: None, 100: camera}, version=(1, 2, 3))


def situation(now=T0, system=5):
    pilot = Autopilot(system=system, component=1, kind=AutopilotKind.PX4, vehicle_type=16, armed=False, link="fc")
    return Situation(now_ns=now, autopilot=pilot if system else None, plane=None, newest_state=lambda: None)


def long(command=HANDLED, target=(5, 100), params=(0.5, 0.5), confirmation=0, sender=(255, 190), signed=False):
    params = (*params, *(0.0,) * (7 - len(params)))
    return Message("COMMAND_LONG", *sender, "ground", Long(*target, command, confirmation, *params), signed)


def acks(out):
    return [one.fields for one in out if one.name == "COMMAND_ACK"]


def test_a_handled_command_is_done_and_acknowledged_to_its_sender_over_its_link(commands, camera):
    (ack,) = commands.on_message(long(), situation())
    assert (ack.name, ack.to, ack.link, ack.component) == ("COMMAND_ACK", Destination.REPLY, "ground", 100)
    packed = mavlink.MAVLink_command_ack_message(**ack.fields)
    assert (packed.command, packed.result) == (HANDLED, mavlink.MAV_RESULT_ACCEPTED)
    assert (packed.target_system, packed.target_component) == (255, 190)
    assert camera.seen[0].params == (0.5, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("component", [100, 191])
@pytest.mark.parametrize("number", [0, 1, 246, 400, 65535])
def test_a_command_without_a_handler_is_unsupported(commands, component, number):
    (ack,) = acks(commands.on_message(long(number, (5, component)), situation()))
    assert ack["result"] == mavlink.MAV_RESULT_UNSUPPORTED


def test_a_command_int_is_taken_with_its_x_y_z(commands, camera):
    fields = Int(5, 100, 0, HANDLED, 0, 0, 0.1, 0.2, 0.3, 0.4, 470_000_000, -80_000_000, 12.5)
    (ack,) = acks(commands.on_message(Message("COMMAND_INT", 255, 190, "ground", fields), situation()))
    assert ack["result"] == mavlink.MAV_RESULT_ACCEPTED
    assert camera.seen[0].params == (0.1, 0.2, 0.3, 0.4, 470_000_000, -80_000_000, 12.5)


@pytest.mark.parametrize("target", [(5, 1), (6, 100), (6, 0), (5, 154), (0, 1)])
def test_what_is_addressed_to_others_is_not_touched(commands, camera, target):
    assert commands.on_message(long(target=target), situation()) == []
    assert camera.seen == []


@pytest.mark.parametrize("target", [(0, 0), (5, 0), (0, 100)])
def test_a_broadcast_is_acknowledged_only_by_who_handles_it(commands, target):
    assert [ack.component for ack in commands.on_message(long(target=target), situation())] == [100]
    assert commands.on_message(long(400, target), situation()) == []


def test_no_command_is_answered_before_an_autopilot_is_adopted(commands, camera):
    assert commands.on_message(long(), situation(system=0)) == []
    assert commands.on_message(Message("PING", 255, 190, "ground", Ping(1, 1, 0, 0)), situation(system=0)) == []
    commands.system = 5  # the configuration sets our system id
    assert len(commands.on_message(long(), situation(system=0))) == 1


def test_our_own_commands_that_come_back_are_not_answered(commands):
    assert commands.on_message(long(sender=(5, 191)), situation()) == []


def test_a_repeated_command_is_acknowledged_again_and_not_done_again(commands, camera):
    for count in range(3):
        (ack,) = acks(commands.on_message(long(confirmation=count), situation(T0 + count * S)))
        assert ack["result"] == mavlink.MAV_RESULT_ACCEPTED
    assert len(camera.seen) == 1


def test_the_same_command_after_another_one_is_a_new_wish(commands, camera):
    for number in (HANDLED, 400, HANDLED):
        commands.on_message(long(number), situation())
    assert len(camera.seen) == 2 + 1  # 400 was offered as well


@pytest.mark.parametrize(
    "other", [{"sender": (254, 190)}, {"params": (0.5, 0.6)}, {"params": (0.5, nan)}], ids=["sender", "params", "nan"]
)
def test_only_the_very_same_is_a_repetition(commands, camera, other):
    commands.on_message(long(), situation())
    commands.on_message(long(**other), situation())
    assert len(camera.seen) == 2


def test_a_repetition_with_the_same_nan_is_one_and_after_a_while_it_is_none(commands, camera):
    for _ in range(2):
        commands.on_message(long(params=(nan, 0.5)), situation())
    assert len(camera.seen) == 1
    commands.on_message(long(params=(nan, 0.5)), situation(T0 + 6 * S))
    assert len(camera.seen) == 2


def test_a_requested_message_is_sent_again_when_it_is_requested_again(commands):
    for _ in range(2):
        ack, version = commands.on_message(long(512, (5, 191), (148.0,)), situation())
        assert ack.fields["result"] == mavlink.MAV_RESULT_ACCEPTED
        packed = mavlink.MAVLink_autopilot_version_message(**version.fields)
        assert packed.flight_sw_version == 0x01020300
        assert packed.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2


def test_the_older_request_for_the_version_works_too(commands):
    ack, version = commands.on_message(long(520, (5, 100), (1.0,)), situation())
    assert (ack.component, version.name, version.component) == (100, "AUTOPILOT_VERSION", 100)


def test_a_provided_message_can_be_requested_and_may_have_nothing_to_tell(commands):
    reported = [{"a": 1}, None]
    commands.provide(191, 390, "ONBOARD_COMPUTER_STATUS", lambda situation: reported.pop(0))
    ack, message = commands.on_message(long(512, (5, 191), (390.0,)), situation())
    assert (message.name, message.fields, message.to) == ("ONBOARD_COMPUTER_STATUS", {"a": 1}, Destination.REPLY)
    (ack,) = acks(commands.on_message(long(512, (5, 191), (390.0,)), situation()))
    assert ack["result"] == mavlink.MAV_RESULT_FAILED


@pytest.mark.parametrize("param", [nan, inf, -inf, -1.0, 3e38, 31.0])
def test_a_request_for_no_message_of_ours_is_unsupported(commands, param):
    (ack,) = acks(commands.on_message(long(512, (5, 191), (param,)), situation()))
    assert ack["result"] == mavlink.MAV_RESULT_UNSUPPORTED


def test_with_a_signing_key_unsigned_commands_do_nothing(camera):
    commands = Commands({191: None, 100: camera}, require_signed=True)
    (ack,) = acks(commands.on_message(long(), situation()))
    assert ack["result"] == mavlink.MAV_RESULT_DENIED
    assert commands.on_message(long(target=(0, 0)), situation()) == []
    assert camera.seen == []
    assert commands.refused_unsigned == 3
    assert acks(commands.on_message(long(signed=True), situation()))[0]["result"] == mavlink.MAV_RESULT_ACCEPTED


def test_a_ping_is_answered_once_and_an_answer_is_not(commands):
    (pong,) = commands.on_message(Message("PING", 245, 190, "ground", Ping(123, 7, 0, 0)), situation())
    assert (pong.to, pong.link, pong.component) == (Destination.REPLY, "ground", 191)
    assert pong.fields == {"time_usec": 123, "seq": 7, "target_system": 245, "target_component": 190}
    assert commands.on_message(Message("PING", 245, 190, "ground", Ping(123, 7, 5, 191)), situation()) == []


def test_the_memory_of_senders_is_bounded(commands):
    for system in range(1, 256):
        commands.on_message(long(sender=(system, 9)), situation())
    assert len(commands._done) <= 16


floats = st.floats(width=32, allow_nan=True, allow_infinity=True)


@settings(derandomize=True, max_examples=200)
@given(number=st.integers(0, 65535), params=st.tuples(*[floats] * 7), component=st.sampled_from([100, 191]))
def test_whatever_is_asked_there_is_exactly_one_acknowledgement(number, params, component):
    commands = Commands({191: None, 100: Handler()})
    out = commands.on_message(long(number, (5, component), params), situation())
    assert len(acks(out)) == 1
    assert all(isinstance(one, Outgoing) for one in out)


@pytest.mark.parametrize(
    "other",
    [{"sender": (254, 190), "params": (0.1, 0.1)}, {"target": (5, 191), "params": (0.1, 0.1)}],
    ids=["another sender", "another component"],
)
def test_the_same_command_after_one_of_another_is_a_new_wish(camera, other):
    """A second STOP after a selection by another is executed, although the same sender's STOP was a second ago."""
    commands = Commands({191: camera, 100: camera})
    for second, wish in enumerate(({}, other, {})):
        (ack,) = acks(commands.on_message(long(**wish), situation(T0 + second * S)))
        assert ack["result"] == mavlink.MAV_RESULT_ACCEPTED
    assert len(camera.seen) == 3


@pytest.mark.parametrize("number", [400, 512, 511], ids=["refused", "a message", "an interval"])
def test_a_command_of_another_that_changes_nothing_leaves_a_repetition_one(camera, number):
    def handler(command, of):
        done = camera(command, of)
        return CommandAnswer(CommandResult.ACCEPTED) if command.number == 511 else done

    commands = Commands({191: None, 100: handler})
    for wish in ({}, {"sender": (254, 190), "command": number, "params": (148.0, 0.0)}, {}):
        commands.on_message(long(**wish), situation())
    assert len([seen for seen in camera.seen if seen.number == HANDLED]) == 1
