"""[act] follow_system_id that another sender has: at the start it ends the service, in flight it is only reported."""

import msgspec
import pytest
from acting_world import AUTOPILOT, T0, S, a_track, click, heartbeat, message, options, situation

from fwav_companion.acting.acting import Acting
from fwav_companion.types import NoticeCode

DISARMED = msgspec.structs.replace(AUTOPILOT, armed=False)
STRANGER = heartbeat((17, 1))
HEARD, ENDS = NoticeCode.ACT_REFUSED, NoticeCode.ACT_MISCONFIGURED


def codes(*heard, signed=False, system=17):
    """The notices after these messages: (second, autopilot, message)."""
    acting = Acting(options(follow_target=True, follow_system_id=system, signed=signed))
    for second, autopilot, each in heard:
        acting.on_message(each, autopilot, T0 + round(second * S))
    return [notice.code for notice in acting.notices()]


@pytest.mark.parametrize(
    ("heard", "expected"),
    [
        ([(0, DISARMED, STRANGER)], [HEARD, ENDS]),
        ([(0, None, STRANGER), (4, DISARMED, heartbeat(armed=False))], [HEARD, ENDS]),  # heard before the autopilot
        ([(0, DISARMED, heartbeat()), (9.9, DISARMED, STRANGER), (9.95, DISARMED, STRANGER)], [HEARD, ENDS]),
        ([(0, DISARMED, heartbeat()), (10, DISARMED, STRANGER)], [HEARD]),  # the start is over
        ([(0, AUTOPILOT, STRANGER), (1, AUTOPILOT, STRANGER)], [HEARD]),  # started again in flight
        ([(0, None, STRANGER), (1, AUTOPILOT, heartbeat())], [HEARD]),
        ([(0, DISARMED, heartbeat((18, 1)))], []),
        ([(0, DISARMED, message("FOLLOW_TARGET", (17, 191)))], []),  # our own that comes back is no sender
    ],
)
def test_heard_id_ends_a_service_on_the_ground_at_its_start_alone(heard, expected):
    assert codes(*heard) == expected


def test_vehicles_own_id_ends_the_service_once_it_is_known():
    vehicle = msgspec.structs.replace(DISARMED, system=17)
    assert codes((0, vehicle, heartbeat((17, 1), armed=False))) == [HEARD, ENDS]


@pytest.mark.parametrize(("signed", "expected"), [(False, [HEARD]), (True, [])])
def test_unsigned_frame_on_a_stations_link_ends_no_service(signed, expected):
    assert codes((0, DISARMED, heartbeat((17, 1), link="ground")), signed=signed) == expected


def test_sender_behind_the_autopilot_ends_it_after_a_stranger_was_heard():
    stranger, behind = heartbeat((17, 1), link="ground"), heartbeat((17, 1))
    assert codes((0, DISARMED, stranger), (1, DISARMED, behind)) == [HEARD, ENDS]


def test_nothing_is_sent_from_an_id_that_is_heard_in_flight():
    acting = Acting(options(follow_target=True, follow_system_id=17))
    acting.on_message(heartbeat(), AUTOPILOT, T0)
    acting.on_selected(click(), a_track(T0), AUTOPILOT, T0)
    assert [each.system for each in acting.on_wake(T0, situation(T0))] == [17]
    acting.on_message(STRANGER, AUTOPILOT, T0 + S)
    assert acting.on_wake(T0 + S, situation(T0 + S)) == []
    assert acting.status().follow_id_heard
