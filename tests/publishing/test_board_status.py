"""The board's status, packed by our codec and read by pymavlink: unknown is unknown, lists keep their order."""

from math import nan

import pytest
from mavlink_wire import parse

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.wire.codec import Encoder
from fwav_companion.publishing.ground_messages import onboard_computer_status
from fwav_companion.types import BoardReport, LinkLoad

NOW = HostNs(12_345_678_000_000)


def sent(report: BoardReport):
    (message,) = parse(Encoder(1, 191).encode("ONBOARD_COMPUTER_STATUS", onboard_computer_status(report, NOW)))
    return message


def test_what_is_known_is_sent():
    links = (LinkLoad(True, 3.4, 80.6), LinkLoad(False, 100.2, 0.1))
    message = sent(BoardReport(cpu=(0.126, 1.0), ram_used_mib=120, ram_total_mib=427, core_celsius=-3.6, links=links))
    assert (message.time_usec, message.uptime) == (12_345_678_000, 12_345_678)
    assert message.cpu_cores == [13, 100] + [255] * 6
    assert (message.ram_usage, message.ram_total) == (120, 427)
    assert message.temperature_core[0] == -4
    assert message.link_type[:3] == [0, 10, 2**32 - 1]
    assert message.link_tx_rate[:3] == [3, 100, 2**32 - 1]
    assert message.link_rx_rate[:3] == [81, 0, 2**32 - 1]


def test_what_is_not_known_says_so():
    message = sent(BoardReport())
    assert message.cpu_cores == [255] * 8
    assert message.cpu_combined == [255] * 10
    assert message.temperature_core == [127] * 8
    assert message.temperature_board == 127
    assert (message.ram_usage, message.ram_total) == (2**32 - 1, 2**32 - 1)
    assert message.link_type == message.link_tx_rate == message.link_tx_max == [2**32 - 1] * 6


@pytest.mark.parametrize("celsius", [nan, 1e9, -1e9, 126.6])
def test_no_reading_is_too_strange_to_be_sent(celsius: float):
    report = BoardReport(cpu=(nan, -1.0, 7.0) * 5, core_celsius=celsius, links=(LinkLoad(False, nan, 1e30),) * 9)
    assert len(sent(report).cpu_cores) == 8
