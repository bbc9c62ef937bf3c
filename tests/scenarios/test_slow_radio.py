"""A 57 600 baud radio behind the service never fills, whatever the autopilot streams and the station asks for."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest
from merged_network import LINKS, MergedNetwork, Station

from sitl_mock import scenario
from sitl_mock.codec import Speaker

UNLIMITED = LINKS + "[rates]\nattitude = 25\n"
"""Attitudes that only the service wants never reach the radio: a quarter of the usual ones costs less to simulate."""
ON_A_RADIO = UNLIMITED.replace("udpout://127.0.0.1:14550", "serial:///dev/ttyUSB0:57600")
DRAIN = 5760.0
"""Bytes a second of 57 600 baud."""
BUFFER_BYTES = 2048
"""Largest allowed backlog: less than the send buffer of a SiK radio, and 0.36 s of the line."""
ALL = 0


class RadioStation(Station):
    """A station behind a radio: its buffer drains at a rate of its own, and its fill level is reported once a
    second.
    """

    def __init__(self, *, drain: float = DRAIN, size: int = 1_000_000, reports: bool = False) -> None:
        super().__init__("ground")
        self.backlogs: list[tuple[float, float]] = []
        """(seconds, bytes in the buffer) after each write."""
        self._drain, self._size = drain, size
        self._backlog = self._last_s = 0.0
        self._report_s = 0.5 if reports else 1e9
        self._radio = Speaker(51, 68)

    def hear(self, data: bytes, now_s: float) -> None:
        self._backlog = max(0.0, self._backlog - self._drain * (now_s - self._last_s)) + len(data)
        self._last_s = now_s
        self.backlogs.append((now_s, self._backlog))
        super().hear(data, now_s)

    def largest_backlog(self, from_s: float = 0.0) -> float:
        return max(size for at_s, size in self.backlogs if at_s >= from_s)

    def bytes_per_s(self, from_s: float, to_s: float) -> float:
        return sum(len(data) for at_s, data in self.writes if from_s <= at_s < to_s) / (to_s - from_s)

    def next_s(self) -> float:
        return min(super().next_s(), self._report_s)

    def take_due(self, now_s: float) -> list[bytes]:
        frames = super().take_due(now_s)
        if self._report_s <= now_s:
            self._report_s += 1.0
            backlog = max(0.0, self._backlog - self._drain * (now_s - self._last_s))
            free = max(0, round(100 * (1.0 - backlog / self._size)))
            fields = {"rssi": 200, "remrssi": 200, "txbuf": free, "noise": 40, "remnoise": 40, "rxerrors": 0}
            frames.append(self._radio.frame("RADIO_STATUS", {**fields, "fixed": 0}))
        return frames


def flown(name: str, station: Station, text: str = ON_A_RADIO, **differences: Any) -> MergedNetwork:
    options = scenario(name).but({"seconds": 36.0, "camera.enabled": False, **differences})
    return MergedNetwork(options, [station], text=text).fly()


@pytest.mark.parametrize(
    ("name", "group_hz"),
    [
        ("px4_onboard", 0),
        pytest.param("arducopter", 50, marks=pytest.mark.slow),
        pytest.param("arducopter", 10, marks=pytest.mark.slow),
        pytest.param("px4_normal", 0, marks=pytest.mark.slow),
    ],
)
def test_the_line_never_fills_and_what_matters_always_arrives(name, group_hz):
    """Fifty commands, and a thousand parameters at five times the speed of the line, on top of the streams."""
    station = RadioStation()
    if group_hz:
        station.ask_group(6.0, ALL, group_hz)
    for number in range(50):
        station.command(10.0 + number / 5, 400, 0.0)
    station.at(12.0, "PARAM_REQUEST_LIST", target_system=1, target_component=1)
    listed = {"autopilot.more_parameters": 1000, "autopilot.parameter_interval_s": 0.0013}
    network = flown(name, station, **listed)
    assert station.largest_backlog() < BUFFER_BYTES
    assert sum(ack["command"] == 400 for ack in station.of("COMMAND_ACK")) == 50
    parameters = {value["param_id"] for value in station.of("PARAM_VALUE")}
    assert parameters >= {f"MORE_{number}" for number in range(1000)}
    beats = [at_s for at_s, heard in station.heard if heard.name == "HEARTBEAT" and heard.component == 1]
    assert max(later - sooner for sooner, later in pairwise(beats)) < 1.5
    during = station.rates(13.0, 20.0)
    assert during["VFR_HUD"] > 0.2, "the display lives on while parameters come"
    after = station.rates(30.0, 36.0)
    assert after["VFR_HUD"] > 2.5
    thinned = network.node.statistics(network._now)[1].thinning
    assert thinned.max_bytes_per_s == pytest.approx(0.7 * DRAIN)


def test_the_line_is_used_and_not_wasted():
    station = RadioStation()
    flown("px4_onboard", station, seconds=24.0)
    assert station.bytes_per_s(10.0, 24.0) == pytest.approx(0.95 * 0.7 * DRAIN, rel=0.05)


@pytest.mark.slow
def test_without_the_budget_the_same_line_would_fill():
    """The simulated line is realistic: without the budget it shows the trouble that the tests above prevent."""
    station = RadioStation()
    flown("px4_onboard", station, text=UNLIMITED)
    assert station.largest_backlog() > 100 * BUFFER_BYTES


@pytest.mark.slow
@pytest.mark.parametrize(("name", "drain"), [("px4_onboard", 1200.0), ("arducopter", 2000.0)])
def test_a_radio_slower_than_its_baud_rate_is_followed_by_its_own_reports(name, drain):
    """Within some seconds of its first reports the buffer is not more than two thirds full; afterwards it stays so,
    the link carries more than half of what it could, and every stream has its share.
    """
    station = RadioStation(drain=drain, size=4096, reports=True).ask_group(6.0, ALL, 10)
    network = flown(name, station, seconds=70.0)
    assert station.largest_backlog(from_s=20.0) < 0.7 * 4096
    assert station.bytes_per_s(30.0, 70.0) == pytest.approx(0.8 * drain, rel=0.35)
    rates = station.rates(30.0, 70.0)
    streams = [rates.get(name, 0.0) for name in ("SYS_STATUS", "VFR_HUD", "ATTITUDE", "GLOBAL_POSITION_INT")]
    assert min(streams) > 0.4
    thinned = network.node.statistics(network._now)[1].thinning
    assert {row.why for row in thinned.messages} & {"radio_status"}


def test_a_radio_with_room_is_not_slowed():
    station = RadioStation(drain=20_000.0, size=4096, reports=True).ask_group(6.0, ALL, 4)
    network = flown("arducopter", station, text=UNLIMITED, seconds=22.0)
    assert station.rates(10.0, 22.0)["VFR_HUD"] == pytest.approx(4.0, abs=0.1)
    assert network.node.statistics(network._now)[1].thinning.max_bytes_per_s is None
