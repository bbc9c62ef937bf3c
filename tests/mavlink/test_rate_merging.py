"""Requests that follow a station's request, so that it does not lower a rate that another station or the service
wants.
"""

from __future__ import annotations

import pytest

from fwav_companion.mavlink.client.rate_dialogue import missing_rates
from fwav_companion.mavlink.wire.rate_messages import RateRequest
from fwav_companion.mavlink.wire.stream_groups import group_ids

ATTITUDE, QUATERNION, POSITION, HUD, ALTITUDE = 30, 31, 33, 74, 141
OURS = {ATTITUDE: 4.0, QUATERNION: 100.0, POSITION: 10.0}
EXTRA1, EXTRA2 = 10, 11


def request(rates, by_group=False):
    return RateRequest(
        system=255, component=190, link="ground", target_system=1, target_component=1, rates=rates, by_group=by_group
    )


def group(number, hz):
    return request(dict.fromkeys(group_ids(number), hz), by_group=True)


def followed(asked, demanded=None, heeds_groups=True):
    """The requests that follow. ``demanded``: rates of other stations; this request's own rates belong to it."""
    rates = {msgid: hz for msgid, hz in asked.rates.items() if hz}
    highest = rates | {msgid: max(hz, rates.get(msgid, 0.0)) for msgid, hz in (demanded or {}).items()}
    left = {msgid: hz or 0.0 for msgid, hz in asked.rates.items()}
    if asked.by_group and not heeds_groups:
        left = {msgid: OURS[msgid] for msgid in asked.rates if msgid in OURS}
    groups, messages = missing_rates(left, OURS, highest, by_group=asked.by_group and heeds_groups)
    return groups, dict(messages)


@pytest.mark.parametrize(
    ("rates", "messages"),
    [
        ({QUATERNION: 4.0}, {QUATERNION: 100.0}),
        ({QUATERNION: 0.0}, {QUATERNION: 100.0}),
        ({QUATERNION: None}, {QUATERNION: 100.0}),
        ({QUATERNION: 100.0}, {}),
        ({QUATERNION: 200.0}, {}),
        ({HUD: 1.0}, {}),
        ({ATTITUDE: 4.0}, {}),
    ],
)
def test_ours_follow_where_they_are_higher_and_nowhere_else(rates, messages):
    assert followed(request(rates)) == ({}, messages)


def test_behind_a_group_all_of_our_messages_in_it_follow():
    assert followed(group(0, 4.0)) == ({}, {POSITION: 10.0})
    assert followed(group(0, 3.0)) == ({}, {POSITION: 10.0, ATTITUDE: 4.0})
    assert followed(group(EXTRA1, 0.0)) == ({}, {ATTITUDE: 4.0})
    assert followed(group(EXTRA2, 1.0)) == ({}, {})


def test_another_station_keeps_its_higher_rate():
    assert followed(request({HUD: 1.0}), {HUD: 10.0}) == ({}, {HUD: 10.0})
    assert followed(request({HUD: 10.0}), {HUD: 1.0}) == ({}, {})


def test_of_ours_and_another_stations_the_higher_one_follows():
    assert followed(request({POSITION: 1.0}), {POSITION: 25.0}) == ({}, {POSITION: 25.0})
    assert followed(request({POSITION: 1.0}), {POSITION: 5.0}) == ({}, {POSITION: 10.0})


def test_ours_is_asked_for_before_a_stations_higher_one_which_the_autopilot_may_refuse():
    _, messages = missing_rates({QUATERNION: 4.0}, OURS, {QUATERNION: 1000.0})
    assert messages == [(QUATERNION, 100.0), (QUATERNION, 1000.0)]


def test_another_station_that_asked_by_group_gets_its_groups_back_in_one_message_each():
    groups, messages = followed(group(EXTRA1, 2.0), dict.fromkeys(group_ids(0), 6.0))
    assert groups == {EXTRA1: 6.0}
    assert messages == {}
    groups, messages = followed(group(EXTRA1, 2.0), dict.fromkeys(group_ids(0), 3.0))
    assert groups == {EXTRA1: 3.0}
    assert messages == {ATTITUDE: 4.0}, "ours is higher still"


def test_an_autopilot_that_ignores_groups_keeps_our_rates_and_is_asked_for_more_of_them_where_a_station_wants_it():
    assert followed(group(0, 4.0), heeds_groups=False) == ({}, {})
    assert followed(group(0, 25.0), heeds_groups=False) == ({}, {ATTITUDE: 25.0, POSITION: 25.0})
    assert followed(request({POSITION: 1.0}), heeds_groups=False) == ({}, {POSITION: 10.0})
