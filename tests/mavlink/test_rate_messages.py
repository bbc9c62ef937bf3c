"""Requests for message rates, read from frames that pymavlink packed."""

from __future__ import annotations

from math import inf, nan

import pytest
from mavlink_wire import Wire, dialect

from fwav_companion.mavlink.wire.rate_messages import RateRequest, rate_request
from fwav_companion.mavlink.wire.scanner import Scanner
from fwav_companion.mavlink.wire.stream_groups import GROUPS, group_ids, group_of
from sitl_mock.codec import NUMBERS
from sitl_mock.streams import GROUPS as GROUPS_OF_THE_MOCK

ATTITUDE, VFR_HUD, SYS_STATUS = 30, 74, 1


def read(frame: bytes) -> RateRequest | None:
    (raw,) = Scanner(datagrams=True).feed(frame)
    return rate_request(raw, "ground", "")


def interval(param1: float, param2: float, *, version: int = 2) -> bytes:
    return Wire(255, 190, version=version).frame("COMMAND_LONG", 1, 1, 511, 0, param1, param2, 0, 0, 0, 0, 0)


@pytest.mark.parametrize("version", [1, 2])
def test_an_interval_in_a_long_command(version):
    request = read(interval(ATTITUDE, 20_000, version=version))
    assert request is not None
    assert dict(request.rates) == {ATTITUDE: pytest.approx(50.0)}
    assert (request.requester, request.sender) == ("255/190 on ground", 255 << 8 | 190)
    assert not request.by_group


def test_an_interval_in_an_integer_command():
    frame = Wire(255, 190).frame("COMMAND_INT", 1, 1, 0, 511, 0, 0, VFR_HUD, 250_000, 0, 0, 0, 0, 0)
    request = read(frame)
    assert request is not None
    assert dict(request.rates) == {VFR_HUD: pytest.approx(4.0)}


@pytest.mark.parametrize(
    ("interval_us", "hz"), [(-1, 0.0), (0, None), (nan, None), (inf, None), (1, 1000.0), (1e9, 1e-3)]
)
def test_minus_one_stops_zero_is_the_default_and_a_microsecond_is_a_millisecond(interval_us, hz):
    request = read(interval(ATTITUDE, interval_us))
    assert request is not None
    assert request.rates[ATTITUDE] == (hz if hz is None else pytest.approx(hz))


@pytest.mark.parametrize("params", [(nan, 1000), (inf, 1000), (-1, 1000), (2**24, 1000)])
def test_what_asks_for_nothing_definite_is_no_request(params):
    assert read(interval(*params)) is None


def test_a_message_interval_of_a_station_asks_too():
    request = read(Wire(255, 190).frame("MESSAGE_INTERVAL", VFR_HUD, 100_000))
    assert request is not None
    assert dict(request.rates) == {VFR_HUD: pytest.approx(10.0)}
    assert request.reaches(7, 1)


def test_a_group_asks_for_each_of_its_messages():
    request = read(Wire(255, 190).frame("REQUEST_DATA_STREAM", 1, 1, dialect.MAV_DATA_STREAM_EXTRA1, 7, 1))
    assert request is not None
    assert request.by_group
    assert request.rates[ATTITUDE] == 7.0
    assert VFR_HUD not in request.rates


@pytest.mark.parametrize(("start", "hz"), [(1, 4.0), (0, 0.0)])
def test_all_groups_start_and_stop_together(start, hz):
    request = read(Wire(255, 190).frame("REQUEST_DATA_STREAM", 1, 1, dialect.MAV_DATA_STREAM_ALL, 4, start))
    assert request is not None
    assert {request.rates[msgid] for msgid in (ATTITUDE, VFR_HUD, SYS_STATUS)} == {hz}


def test_a_group_that_neither_starts_nor_stops_is_no_request():
    assert read(Wire(255, 190).frame("REQUEST_DATA_STREAM", 1, 1, 0, 4, 2)) is None


def test_a_single_message_is_wanted_once():
    frame = Wire(255, 190).frame("COMMAND_LONG", 1, 1, 512, 0, ATTITUDE, 0, 0, 0, 0, 0, 0)
    request = read(frame)
    assert request is not None
    assert (request.once, dict(request.rates)) == (ATTITUDE, {})


@pytest.mark.parametrize(
    ("target", "reached"), [((0, 0), True), ((1, 0), True), ((1, 1), True), ((1, 100), False), ((2, 1), False)]
)
def test_whom_it_reaches(target, reached):
    request = read(Wire(255, 190).frame("REQUEST_DATA_STREAM", *target, 0, 4, 1))
    assert request is not None
    assert request.reaches(1, 1) is reached


def test_other_frames_are_no_requests():
    wire = Wire(255, 190)
    for frame in (wire.heartbeat(6, 8), wire.command(1, 1, 400), wire.attitude()):
        assert read(frame) is None


def test_the_mocks_groups_are_parts_of_ours():
    """Both were written from ArduPilot's source, the mock's for what it can send."""
    for number, names in GROUPS_OF_THE_MOCK.items():
        assert {NUMBERS[name] for name in names} <= group_ids(number)


def test_a_message_is_in_one_group_and_all_is_their_union():
    members = [msgid for number in GROUPS for msgid in group_ids(number)]
    assert len(members) == len(set(members))
    assert set(members) < group_ids(0)
    assert group_of(ATTITUDE) == dialect.MAV_DATA_STREAM_EXTRA1
    assert group_of(NUMBERS["ATTITUDE_QUATERNION"]) is None
    assert group_ids(99) == frozenset()
