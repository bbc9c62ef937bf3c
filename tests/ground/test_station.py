"""What the picture's ground station asks vehicles for, and how often."""

from __future__ import annotations

import pytest
from mavlink_wire import Wire

from fwav_companion.ground import station as station_module
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.station import RARE_STEP_S, PictureStation
from fwav_companion.links.url import parse_link_url
from fwav_companion.mavlink.wire.scanner import Scanner

NOW = 1_790_000_000.0
COMMAND_LONG = 76


class Wires:
    """In place of a link: what the station sends, and the way in."""

    def __init__(self, _name, _url, on_bytes, _on_state) -> None:
        self.on_bytes = on_bytes
        self.asked: list[int] = []

    def start(self) -> None:
        """Nothing to open."""

    def send(self, data: bytes) -> None:
        frames = Scanner(datagrams=True).feed(data)
        self.asked += [frame.target_system for frame in frames if frame.msgid == COMMAND_LONG]


def test_a_vehicle_is_asked_though_strangers_used_its_id_and_those_of_all_others_before(
    monkeypatch: pytest.MonkeyPatch,
):
    """A minute of invented heartbeats used up all requests to a vehicle that came later, and 200 of them all places."""
    wires: list[Wires] = []
    monkeypatch.setattr(station_module, "make_link", lambda *words: wires.append(Wires(*words)) or wires[-1])
    clock = [NOW]
    url = parse_link_url("udpin://127.0.0.1:14550")
    station = PictureStation([url], GroundPicture(), clock=lambda: clock[0], hfov_deg=None)
    station.start()
    (wire,) = wires
    for system in range(1, 254):
        wire.on_bytes("link 1", Wire(system, 1).heartbeat())
    for second in range(200):
        clock[0] = NOW + second
        station.tick(clock[0])
    often = len(wire.asked)
    wire.asked.clear()
    for second in range(200, 200 + round(RARE_STEP_S)):
        clock[0] = NOW + second
        station.tick(clock[0])
    assert set(wire.asked) == set(range(1, 254))
    assert len(wire.asked) < 0.2 * often
