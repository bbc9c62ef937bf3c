"""Acknowledgements that are lost, wrong, addressed to others, or report the request as unsupported."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from rates_peer import Ack, peer, status

from fwav_companion.types import AutopilotKind, Message


def test_an_acknowledgement_without_the_rate_is_not_believed():
    """PX4 acknowledged 50 Hz and sent 18.4: the measured rate is shown, and requested again at growing intervals."""
    them = peer(kind=AutopilotKind.PX4, attitude_hz=50)
    them.gives_hz = 18.4
    them.start().run(200)
    got = status(them, "ATTITUDE_QUATERNION")
    assert got.asked_hz == 50.0
    assert got.measured_hz == pytest.approx(18.4, rel=0.05)
    assert 3 <= len(them.asks_for("ATTITUDE_QUATERNION")) <= 8


def test_a_lost_acknowledgement_is_asked_for_again_with_a_growing_confirmation():
    them = peer()
    them.acknowledges = False
    them.start().run(5.5)
    first = [out.fields for _, out in them.sent if out.fields.get("param1") == 31.0 and out.fields["command"] == 511]
    assert [fields["confirmation"] for fields in first] == [0, 1, 2, 3]


def test_a_rate_that_comes_without_any_acknowledgement_counts():
    them = peer()
    them.acknowledges = False
    them.start().run(120)
    assert status(them, "ATTITUDE_QUATERNION").state == "granted"


def test_data_streams_are_requested_only_where_the_command_itself_is_unknown():
    them = peer()
    them.result = mavlink.MAV_RESULT_UNSUPPORTED
    them.start().run(10)
    streams = [out.fields for _, out in them.sent if out.name == "REQUEST_DATA_STREAM"]
    assert {fields["req_stream_id"]: fields["req_message_rate"] for fields in streams}[10] == 100
    assert status(them, "ATTITUDE").measured_hz == pytest.approx(100, rel=0.02)
    for fields in streams:
        mavlink.MAVLink_request_data_stream_message(**fields)

    modern = peer()
    modern.denied = {"GPS_RAW_INT"}
    modern.start().run(30)
    assert not [out for _, out in modern.sent if out.name == "REQUEST_DATA_STREAM"]


def test_one_request_serves_all_messages_of_its_data_stream():
    """PX4's profile wants both positions, which are one stream."""
    them = peer(kind=AutopilotKind.PX4)
    them.result = mavlink.MAV_RESULT_UNSUPPORTED
    them.start().run(5)
    streams = [out.fields["req_stream_id"] for _, out in them.sent if out.name == "REQUEST_DATA_STREAM"]
    assert streams.count(mavlink.MAV_DATA_STREAM_POSITION) == 1
    for name in ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"):
        assert status(them, name).state == "granted"


def test_unsupported_for_one_message_is_a_refusal_where_others_were_accepted():
    them = peer()
    grant = them.grant
    them.grant = lambda name, us: mavlink.MAV_RESULT_UNSUPPORTED if name == "GPS_RAW_INT" else grant(name, us)
    them.start().run(10)
    assert status(them, "GPS_RAW_INT").state == "denied"
    assert not [out for _, out in them.sent if out.name == "REQUEST_DATA_STREAM"]


@pytest.mark.parametrize(
    "ack",
    [Ack(511, 4, 0, 0, 255, 190), Ack(400, 4, 0, 0, 1, 191), Ack(511, 5, 0, 0, 1, 191), Ack(511, 4, 0, 0, 1, 100)],
)
def test_acknowledgements_of_others_and_of_progress_are_not_taken(ack):
    them = peer()
    them.acknowledges = False
    them.start().run(2.2)
    them.deliver(Message("COMMAND_ACK", 1, 1, "fc", ack))
    assert status(them, "ATTITUDE_QUATERNION").state == "asking"
    assert len(them.run(0.5).asked) == 1
