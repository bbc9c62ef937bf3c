"""Acting on a target under forged messages: a twin flies beside it unattacked, and both send the same.

Forged is what the router passes on: a station's link does not bear the vehicle's system, a payload's not its autopilot.
"""

from __future__ import annotations

import random
from collections.abc import Iterator

import pytest
from acting_world import AUTOPILOT, CONFIGURE, REQUEST, ROI, STATION, T0, S, a_track, click, heartbeat, message, options
from acting_world import situation as situation_at

from fwav_companion.acting.acting import Acting
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.types import Message

STEP = S // 10
NOBODY, OURS = (0, 0), (1, 191)
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


class Flown:
    """The acting of a flight, with an autopilot that answers and a gimbal manager that gives the control."""

    def __init__(self, point: str, **changes: object) -> None:
        self.acting = Acting(options(point=point, follow_target=True, follow_max_sigma_m=10.0, **changes))
        self.sent: list[str] = []
        self._primary = NOBODY
        self.hear(heartbeat(), T0)

    def hear(self, each: Message, now: int) -> None:
        self.acting.on_message(each, AUTOPILOT, HostNs(now))

    def select(self, now: int = T0) -> None:
        self.acting.on_selected(click(), a_track(now), AUTOPILOT, HostNs(now))

    def step(self, now: int, *, station: bool = True) -> None:
        """A tenth of a second: who is genuine speaks, the target moves, what is due is sent."""
        self.hear(heartbeat(), now)
        if station:
            self.hear(heartbeat(STATION, link="ground"), now)
        place = (20.0 + (now - T0) / S, 3.0, 0.0)
        self.acting.on_tracks(a_track(now, place, ray=(0.0, 0.0, 1.0)), HostNs(now), awaited=False)
        due = self.acting.wake_at
        made = self.acting.on_wake(HostNs(now), situation_at(now)) if due is not None and due <= now else []
        for each in made:
            self.sent.append(repr(each))
            number = each.fields.get("command")
            if number == CONFIGURE:
                self._primary = (int(each.fields["param1"]), int(each.fields["param2"]))
            if number == ROI:
                self.hear(message("COMMAND_ACK", command=ROI, result=0), now)
            if number == REQUEST:
                self._answer(now)

    def _answer(self, now: int) -> None:
        sysid, compid = self._primary
        primary = {"primary_control_sysid": sysid, "primary_control_compid": compid}
        fields = {"gimbal_device_id": 1, "flags": 0, **primary}
        self.hear(message("GIMBAL_MANAGER_STATUS", **fields), now)


@pytest.mark.parametrize("point", ["gimbal", "roi", "none"])
@pytest.mark.parametrize("signed", [False, True], ids=["without a key", "with a key"])
def test_forged_messages_command_nothing_without_a_selection(point, signed):
    draw, flown = random.Random(1), Flown(point, signed=signed)
    for k in range(60):
        for each in forged(draw):
            flown.hear(each, T0 + k * STEP)
        flown.step(T0 + k * STEP)
    assert flown.sent == []


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("point", ["gimbal", "roi", "none"])
def test_forged_messages_change_nothing_of_what_is_sent(point, seed):
    """The station falls silent after 6 s: what bears its ids elsewhere does not keep the permission."""
    draw = random.Random(seed)
    attacked, calm = Flown(point), Flown(point)
    for flown in (attacked, calm):
        flown.select()
    for k in range(1, 130):
        now = T0 + k * STEP
        for each in forged(draw):
            attacked.hear(each, now)
        for flown in (attacked, calm):
            flown.step(now, station=k < 60)
        assert attacked.sent == calm.sent, k
    assert len(calm.sent) > 20
    assert calm.acting.status().last_end == "the selecting station is silent"
    texts = [[notice.text for notice in flown.acting.notices()] for flown in (attacked, calm)]
    assert texts[0] == texts[1]


def test_unsigned_station_with_the_id_to_follow_from_ends_nothing_with_a_key():
    """Without a key it does: another vehicle with this id would be followed."""
    for signed, stops in ((True, False), (False, True)):
        flown = Flown("none", signed=signed, follow_system_id=42)
        flown.hear(heartbeat((42, 1), link="ground"), T0)
        assert flown.acting.status().follow_id_heard is stops
