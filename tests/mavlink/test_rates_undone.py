"""Another component changes a rate: it is requested again, and the component is named where its request was seen."""

from collections import namedtuple

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from rates_peer import MS, peer, status

from fwav_companion.types import Message, NoticeCode

Beat = namedtuple("Beat", "type")
Command = namedtuple("Command", "command")


def test_a_foreign_rate_request_is_undone_at_once_and_named():
    them = peer().start().run(20)
    before = len(them.asked)
    them.gcs_requests_streams()
    them.rates.on_rate_request_passed("255/190 over ground", them.now)
    them.run(0.1)
    assert "ATTITUDE_QUATERNION" in [name for name, _ in them.asked[before:]]
    them.run(6)
    got = status(them, "ATTITUDE_QUATERNION")
    assert got.measured_hz == pytest.approx(100, rel=0.02)
    assert got.undone_by == "255/190 over ground"
    (text,) = (notice.text for notice in them.rates.notices() if notice.code is NoticeCode.RATES_TAKEN)
    assert "255/190 over ground" in text


def test_half_a_dozen_requests_in_a_row_are_all_undone_within_a_second():
    them = peer().start().run(20)
    for _ in range(6):
        them.gcs_requests_streams()
        them.rates.on_rate_request_passed("255/190 over ground", them.now)
        them.run(0.04)
    them.run(1.0)
    assert them.intervals_ns["ATTITUDE_QUATERNION"] == 10 * MS
    asked_once = [name for name, _ in them.asked].count("GPS_RAW_INT")
    assert asked_once <= 3


def test_a_rate_that_falls_without_a_visible_cause_is_requested_again_and_reported():
    them = peer().start().run(20)
    them.gcs_requests_streams()
    them.run(8)
    got = status(them, "ATTITUDE_QUATERNION")
    assert got.measured_hz == pytest.approx(100, rel=0.02)
    assert got.undone_by == "no station seen"
    assert NoticeCode.RATE_FELL in [notice.code for notice in them.rates.notices()]


@pytest.mark.parametrize(("left", "fell"), [(0.78, False), (0.62, True)])
@pytest.mark.parametrize("name", ["ATTITUDE_QUATERNION", "GLOBAL_POSITION_INT"])
def test_a_rate_fell_where_less_than_70_percent_of_it_is_left(name, left, fell):
    """A radio that loses one message in five changes no rate."""
    them = peer().start().run(20)
    them.rates.notices()
    them.set_rate(name, left * (100.0 if name == "ATTITUDE_QUATERNION" else 10.0))
    them.gives_hz = left * 100.0  # the repeated request is granted, and the rate stays low
    them.run(12)
    assert any(f"{name} fell from" in notice.text for notice in them.rates.notices()) is fell


def test_a_ground_station_that_shares_the_link_is_presumed_to_have_taken_a_rate():
    """Its request did not pass through us; its heartbeat shows that it is there."""
    them = peer().start().run(18)
    them.deliver(Message("HEARTBEAT", 255, 190, "fc", Beat(mavlink.MAV_TYPE_GCS)))
    them.deliver(Message("HEARTBEAT", 254, 190, "ground", Beat(mavlink.MAV_TYPE_GCS)))  # its requests pass us by
    them.deliver(Message("HEARTBEAT", 1, 154, "fc", Beat(mavlink.MAV_TYPE_GIMBAL)))
    them.gcs_requests_streams()
    them.run(8)
    assert status(them, "ATTITUDE_QUATERNION").undone_by == "presumably the ground station 255/190 on fc"
    assert any("255/190" in each.text for each in them.rates.notices() if each.code is NoticeCode.RATE_FELL)


def test_a_component_whose_command_was_heard_is_named():
    them = peer().start().run(20)
    them.deliver(Message("COMMAND_LONG", 1, 195, "fc", Command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)))
    them.gcs_requests_streams()
    them.run(8)
    assert status(them, "ATTITUDE_QUATERNION").undone_by == "1/195 on fc"


def test_no_component_is_blamed_for_a_link_that_fell_silent():
    them = peer().start().run(20)
    them.rates.notices()
    deliver, them.deliver = them.deliver, lambda message: None
    them.run(6)
    them.deliver = deliver
    them.run(10)
    assert status(them, "ATTITUDE_QUATERNION").measured_hz == pytest.approx(100, rel=0.02)
    assert {got.undone_by for got in them.rates.status().values()} == {None}
    assert NoticeCode.RATE_FELL not in [notice.code for notice in them.rates.notices()]


def test_a_rate_that_is_taken_again_and_again_is_not_fought_for_more_than_once_in_four_seconds():
    them = peer().start().run(20)
    before = len(them.asks_for("ATTITUDE_QUATERNION"))
    for _ in range(120):
        them.gcs_requests_streams()
        them.run(0.5)
    assert len(them.asks_for("ATTITUDE_QUATERNION")) - before <= 16
