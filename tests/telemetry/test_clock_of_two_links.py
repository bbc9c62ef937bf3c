"""Two links to one autopilot: each has a clock estimate, and the one of least sigma is used."""

import pytest

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, BootNs, HostNs
from fwav_companion.telemetry.clock.clock import Clock
from fwav_companion.types import ClockExchange

OFFSET_NS = 7_000 * NS_PER_S
UP_DOWN_MS = {"serial": (3.5, 3.5), "radio": (20.0, 60.0)}
"""Delays of request and answer: half of the radio's difference, 20 ms, is an error that its exchanges cannot show."""


class Flight:
    def __init__(self) -> None:
        self.clock = Clock()
        self.now_s = 0.0
        self.offset_ns = OFFSET_NS

    def fly(self, seconds: float, links: tuple[str, ...]) -> None:
        """Exchange ten times a second over these links."""
        for _ in range(round(10 * seconds)):
            self.now_s += 0.1
            for link in links:
                self.exchange(link)

    def exchange(self, link: str) -> None:
        up_ns, down_ns = (round(ms * NS_PER_MS) for ms in UP_DOWN_MS[link])
        sent_ns = HostNs(OFFSET_NS + round(self.now_s * NS_PER_S))
        boot_ns, received_ns = BootNs(sent_ns + up_ns - self.offset_ns), HostNs(sent_ns + up_ns + down_ns)
        self.clock.on_exchange(ClockExchange(sent_ns, received_ns, boot_ns, link=link))
        self.clock.on_arrival(boot_ns, received_ns, link)

    @property
    def error_ms(self) -> float:
        return abs(self.estimate.host_from_autopilot_ns - self.offset_ns) / NS_PER_MS

    @property
    def estimate(self):
        return self.clock.estimate(HostNs(OFFSET_NS + round(self.now_s * NS_PER_S)))


@pytest.mark.parametrize("links", [("serial", "radio"), ("radio", "serial")])
def test_clock_of_two_links_is_that_of_the_shorter_round_trip_whichever_spoke_first(links):
    flight = Flight()
    flight.fly(10.0, links)
    assert flight.error_ms < 0.01
    assert flight.estimate.round_trip_s == pytest.approx(0.007)


def test_clock_that_pauses_after_the_better_link_fell_silent_is_right_by_the_other_link():
    flight = Flight()
    flight.fly(10.0, ("serial", "radio"))
    flight.fly(2.0, ("radio",))
    flight.offset_ns += NS_PER_S // 2
    flight.fly(2.0, ("radio",))
    assert flight.error_ms == pytest.approx(20.0, abs=0.1)
    assert flight.error_ms <= 3e3 * flight.estimate.sigma_s


def test_each_exchange_counts_for_its_own_link_alone():
    """Were they mixed, each second one would contradict the line by 20 ms."""
    flight = Flight()
    flight.fly(10.0, ("radio",))
    assert flight.error_ms == pytest.approx(20.0, abs=0.01)
    assert flight.error_ms <= 3e3 * flight.estimate.sigma_s
    flight.fly(0.3, ("radio", "serial"))
    assert flight.error_ms < 0.01
