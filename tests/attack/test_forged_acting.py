"""Acting on a target under forged messages: a twin flies beside it unattacked, and both send the same.

Forged is what the router passes on: a station's link does not bear the vehicle's system, a payload's not its autopilot.
"""

from __future__ import annotations

import random
from collections.abc import Iterator

import pytest
from acting_world import CONFIGURE, NOBODY, OURS, REQUEST, ROI, STATION, T0, Acted, S, a_track, heartbeat, message

from fwav_companion.types import Message

STEP = S // 10
FORGERS = (
    ("ground", (255, 191)),
    ("ground", (2, 1)),
    ("ground", (42, 1)),
    ("payload", STATION),
    ("payload", (1, 154)),
    ("payload", (1, 200)),
    ("payload", (0, 0)),
    ("payload", (2, 1)),
)
"""(link, ids) of strangers: of the selecting station too, where a selection would not count."""


def forged(draw: random.Random) -> Iterator[Message]:
    """Messages that would take, give back or end the control if they were believed."""
    for link, sender in FORGERS:
        primary = draw.choice((NOBODY, OURS, STATION))
        yield message(
            "GIMBAL_MANAGER_STATUS",
            sender,
            link,
            gimbal_device_id=draw.choice((0, 1, 2, 154)),
            primary_control_sysid=primary[0],
            primary_control_compid=primary[1],
            flags=draw.getrandbits(14),
        )
        low, high = sorted((draw.uniform(-3.0, 3.0), draw.uniform(-3.0, 3.0)))
        yield message(
            "GIMBAL_MANAGER_INFORMATION",
            sender,
            link,
            gimbal_device_id=1,
            pitch_min=low,
            pitch_max=high,
            yaw_min=low,
            yaw_max=high,
        )
        yield message("COMMAND_ACK", sender, link, command=draw.choice((CONFIGURE, ROI)), result=draw.randrange(7))
        yield message("EXTENDED_SYS_STATE", sender, link, landed_state=draw.randrange(5))
        yield message("GIMBAL_DEVICE_ATTITUDE_STATUS", sender, link)
        yield message("FOLLOW_TARGET", sender, link, lat=0, lon=0)
        yield heartbeat(sender, armed=draw.random() < 0.5, status=draw.randrange(9), mode=draw.randrange(30), link=link)


def flown(point: str, **changes: object) -> Acted:
    return Acted(point, follow_target=True, **changes)


def step(each: Acted, now: int, *, station: bool = True) -> None:
    """A tenth of a second, in which the target moves."""
    place = (20.0 + (now - T0) / S, 3.0, 0.0)
    each.step(now, a_track(now, place, ray=(0.0, 0.0, 1.0)), station=station)


@pytest.mark.parametrize("point", ["gimbal", "roi", "none"])
@pytest.mark.parametrize("signed", [False, True], ids=["without a key", "with a key"])
def test_forged_messages_command_nothing_without_a_selection(point, signed):
    draw, calm = random.Random(1), flown(point, signed=signed)
    for k in range(60):
        for each in forged(draw):
            calm.hear(each, T0 + k * STEP)
        step(calm, T0 + k * STEP)
    assert calm.sent == [] if point != "gimbal" else len(calm.sent) <= 2 * 5
    assert all(each.fields["command"] == REQUEST for _, each in calm.sent)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("point", ["gimbal", "roi", "none"])
def test_forged_messages_change_nothing_of_what_is_sent(point, seed):
    """The station falls silent after 6 s: what bears its ids elsewhere does not keep the permission."""
    draw = random.Random(seed)
    attacked, calm = flown(point), flown(point)
    for one in (attacked, calm):
        one.select()
    for k in range(1, 130):
        now = T0 + k * STEP
        for each in forged(draw):
            attacked.hear(each, now)
        for one in (attacked, calm):
            step(one, now, station=k < 60)
        assert list(map(repr, attacked.sent)) == list(map(repr, calm.sent)), k
    assert len(calm.sent) > 20
    assert calm.acting.status().last_end == "the selecting station is silent"
    assert attacked.texts == calm.texts


def test_unsigned_station_with_the_id_to_follow_from_ends_nothing_with_a_key():
    """Without a key it does: another vehicle with this id would be followed."""
    for signed, stops in ((True, False), (False, True)):
        one = flown("none", signed=signed, follow_system_id=42)
        one.hear(heartbeat((42, 1), link="ground"), T0)
        assert one.acting.status().follow_id_heard is stops
