"""Lists our requests that must follow a station's request for rates, so that it does not lower a requested rate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec

from fwav_companion.mavlink.wire.rate_messages import RateRequest
from fwav_companion.mavlink.wire.stream_groups import GROUPS, group_ids

ROUNDING = 1.001
"""Ratio below which two rates are equal: intervals are whole microseconds on the wire, whole milliseconds in
autopilots."""


class FollowUp(msgspec.Struct, frozen=True):
    """Rates to request after a station's request, hertz: first the groups, then the messages."""

    groups: Mapping[int, float]
    """Rate by MAV_DATA_STREAM, hertz."""
    messages: Sequence[tuple[int, float]]
    """(message id, hertz), in order of sending: our rate before a station's higher one, which the autopilot may
    refuse."""


def follow_up(
    request: RateRequest, ours_hz: Mapping[int, float], demanded_hz: Mapping[int, float], *, heeds_groups: bool
) -> FollowUp:
    """Return the rates that are higher than those left by the request, for every message that it names.

    ``ours_hz``: rates of this service; ``demanded_hz``: the highest rates of all stations, with this request.
    ``heeds_groups``: the autopilot acts on REQUEST_DATA_STREAM. If it does not, a request by group leaves our messages
    at our rate, and the station's rate follows if it is higher.
    """
    if request.by_group and not heeds_groups:
        left_hz = {msgid: ours_hz[msgid] for msgid in request.rates if msgid in ours_hz}
    else:
        left_hz = {msgid: hz or 0.0 for msgid, hz in request.rates.items()}
    groups = _whole_groups(left_hz, demanded_hz) if request.by_group and heeds_groups else {}
    left_hz |= {msgid: hz for number, hz in groups.items() for msgid in group_ids(number)}
    ours = {msgid: hz for msgid in left_hz if _is_higher(hz := ours_hz.get(msgid, 0.0), left_hz[msgid])}
    left_hz |= ours
    theirs = {msgid: hz for msgid in left_hz if _is_higher(hz := demanded_hz.get(msgid, 0.0), left_hz[msgid])}
    return FollowUp(groups, [*ours.items(), *theirs.items()])


def _whole_groups(left_hz: Mapping[int, float], demanded_hz: Mapping[int, float]) -> dict[int, float]:
    """Return the groups to request as a whole: all their messages are demanded at one rate, above that left by the
    request.

    This is the case where another station requested by group too.
    """
    groups = {}
    for number in GROUPS:
        members = group_ids(number)
        if not members <= left_hz.keys():
            continue
        rates_hz = {demanded_hz.get(msgid, 0.0) for msgid in members}
        hz = rates_hz.pop()
        if not rates_hz and _is_higher(hz, max(left_hz[msgid] for msgid in members)):
            groups[number] = hz
    return groups


def _is_higher(hz: float, than_hz: float) -> bool:
    return hz > ROUNDING * than_hz
