"""The arrival envelope alone: it must tolerate the arrival delays of a busy machine."""

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.telemetry.clock.arrivals import ARRIVALS_TO_BEGIN, BUCKET_NS, ArrivalEnvelope
from fwav_companion.telemetry.clock.clock import Clock


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


def test_a_link_whose_least_delay_wanders_bounds_nothing_closer_than_its_sigma():
    """From a real ground station's log: a radio that sends collected data up to seconds late."""
    clock = Clock()
    for second, late_ms in enumerate((20, 1000, 700, 5, 300, 1400, 600, 90, 400, 800, 1200, 30)):
        for k in range(4):
            stamp = BootNs((100 + second) * BUCKET_NS + k * 250_000_000)
            clock.on_arrival(stamp, HostNs(stamp + 500 * BUCKET_NS + late_ms * 1_000_000))
    reported = clock.estimate(HostNs(612 * BUCKET_NS))
    assert reported.sigma_s > 0.2
    assert reported.bound_s >= 3.0 * reported.sigma_s
