"""A peer whose rates are merged with stations' requests: the requests, and what follows them."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from rates_peer import peer

from fwav_companion.mavlink.wire.rate_messages import RateRequest

ATTITUDE, QUATERNION, POSITION, GPS, HUD = 30, 31, 33, 24, 74
SET, GET = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_GET_MESSAGE_INTERVAL


def merging(**how):
    return peer(**how)


def by_itself(them):
    return dict(them.rates.own_streams.before_hz)


def request(rates, by_group=False, target=(1, 1), system=255):
    return RateRequest(
        system=system, component=190, link="ground", target_system=target[0], target_component=target[1], rates=rates,
        by_group=by_group,
    )  # fmt: skip


def follow(them, asked, demanded=None):
    """The requests that follow at once, after the autopilot has accepted both."""
    for msgid, hz in asked.rates.items():
        name = {ATTITUDE: "ATTITUDE", QUATERNION: "ATTITUDE_QUATERNION", POSITION: "GLOBAL_POSITION_INT"}.get(msgid)
        if name in them.intervals_ns and hz:
            them.set_rate(name, hz)
    highest = {msgid: hz for msgid, hz in asked.rates.items() if hz} | (demanded or {})
    followed = them.rates.on_merged_requests([asked], highest, them.now)
    for out in followed:
        them.take(out)
    return [
        (int(out.fields["param1"]), round(1e6 / out.fields["param2"]))
        if out.name == "COMMAND_LONG"
        else (out.name, out.fields["req_stream_id"], out.fields["req_message_rate"])
        for out in followed
    ]
