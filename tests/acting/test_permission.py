"""Who permits to act on a target, and what ends it."""

import msgspec
import pytest
from acting_world import AUTOPILOT, CRITICAL, STANDBY, STATION, T0, S, click, heartbeat, message, options

from fwav_companion.acting.permission import End, Permission, SelectionRefusal


def flying(**changes):
    permission = Permission(options(**changes))
    permission.on_message(heartbeat(), AUTOPILOT, T0)
    return permission


def selected(**changes):
    permission = flying(**changes)
    assert permission.select(click(), AUTOPILOT, T0) is None
    return permission


def test_nothing_is_permitted_without_a_selection():
    assert flying().selector is None


@pytest.mark.parametrize(
    ("link", "sender", "signed", "refusal"),
    [
        ("ground", STATION, False, None),
        ("fc", STATION, False, SelectionRefusal.UNTRUSTED),  # a station behind the autopilot, unsigned
        ("gimbal", (1, 154), False, SelectionRefusal.UNTRUSTED),
        ("fc", (1, 1), False, None),  # the autopilot forwards it as its own
        ("gimbal", (1, 1), True, None),
        ("fc", STATION, True, None),  # with a key, what was obeyed was signed
    ],
)
def test_selection_counts_on_a_gcs_link_from_the_autopilot_or_signed(link, sender, signed, refusal):
    permission = flying(signed=signed)
    assert permission.select(click(link, sender), AUTOPILOT, T0) is refusal
    assert (permission.selector is None) is (refusal is not None)


@pytest.mark.parametrize(
    "before",
    [[], [heartbeat(armed=False)], [heartbeat(status=STANDBY)], [message("EXTENDED_SYS_STATE", landed_state=1)]],
)
def test_selection_before_the_take_off_does_not_count(before):
    permission = Permission(options())
    for each in [heartbeat(), *before] if before else []:
        permission.on_message(each, AUTOPILOT, T0)
    assert permission.select(click(), AUTOPILOT, T0) is SelectionRefusal.NOT_FLYING
    assert permission.selector is None


@pytest.mark.parametrize(
    ("heard", "end"),
    [
        (heartbeat(), None),
        (heartbeat(armed=False), End.DISARMED),
        (heartbeat(status=STANDBY), End.LANDED),
        (heartbeat(status=CRITICAL), End.FAILSAFE),
        (heartbeat(status=8), End.FAILSAFE),
        (message("EXTENDED_SYS_STATE", landed_state=1), End.LANDED),
        (message("EXTENDED_SYS_STATE", landed_state=2), None),
        (heartbeat((2, 1), armed=False), None),  # another vehicle
    ],
)
def test_flight_that_ends_ends_the_permission(heard, end):
    assert selected().on_message(heard, AUTOPILOT, T0 + S) is end


@pytest.mark.parametrize(("point", "end"), [("roi", End.MODE_CHANGED), ("gimbal", None), ("none", None)])
def test_change_of_the_flight_mode_ends_what_may_turn_the_nose(point, end):
    """Follow needs the pilot to choose its mode after the selection."""
    assert selected(point=point).on_message(heartbeat(mode=23), AUTOPILOT, T0 + S) is end


def test_five_seconds_without_the_selecting_station_end_it():
    permission = selected()
    permission.on_message(heartbeat((254, 190), link="ground"), AUTOPILOT, T0 + 3 * S)  # another station
    permission.on_message(heartbeat(STATION, link="ground"), AUTOPILOT, T0 + 2 * S)
    assert permission.on_wake(T0 + 7 * S - 1) is None
    assert permission.on_wake(T0 + 7 * S) is End.STATION_SILENT


@pytest.mark.parametrize(
    ("signed", "link", "verified", "kept"),
    [
        (False, "ground", False, True),
        (False, "tablet", False, True),
        (False, "gimbal", False, False),  # a payload cannot select
        (True, "ground", False, False),  # forged
        (True, "ground", True, True),
        (True, "fc", True, True),
    ],
)
def test_only_what_could_select_keeps_the_permission_of_its_station(signed, link, verified, kept):
    permission = selected(signed=signed, gcs_links=frozenset({"ground", "tablet"}))
    beat = msgspec.structs.replace(heartbeat(STATION, link=link), signed=verified)
    permission.on_message(beat, AUTOPILOT, T0 + 4 * S)
    assert (permission.on_wake(T0 + 6 * S) is None) is kept
