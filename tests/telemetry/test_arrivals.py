"""The arrival envelope alone: what a busy machine makes of arrivals must not stop it."""

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.telemetry.arrivals import ARRIVALS_TO_BEGIN, BUCKET_NS, ArrivalEnvelope


def test_messages_of_two_seconds_that_came_in_one_datagram_have_one_instant_and_no_slope():
    envelope = ArrivalEnvelope()
    arrival = HostNs(900 * BUCKET_NS)
    for _ in range(ARRIVALS_TO_BEGIN):
        envelope.insert(BootNs(BUCKET_NS - 1), arrival)
    envelope.insert(BootNs(BUCKET_NS + 1), arrival)
    assert envelope.line is not None
    assert abs(envelope.line.offset_ns - (arrival - BUCKET_NS)) <= 2
    envelope.insert(BootNs(3 * BUCKET_NS), HostNs(arrival + 2 * BUCKET_NS))
    assert abs(envelope.line.skew) <= 1e-3
