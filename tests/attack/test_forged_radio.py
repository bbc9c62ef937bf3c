"""Forged RADIO_STATUS on a station's link: a radio cannot sign, so anyone on that link can slow it, and only it."""

from __future__ import annotations

import pytest
from mavlink_wire import Wire
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.router.node import LinkPolicy, Node, SigningPolicy
from fwav_companion.mavlink.wire.scanner import Scanner
from fwav_companion.pipeline.pipeline_factory import WANTED

KEY = bytes(range(32))
START = 40_000_000_000_000
TICK_NS = 20 * NS_PER_MS


class Net:
    """A vehicle and a station, with or without a key, and a second station's link."""

    def __init__(self, *, has_key: bool) -> None:
        links = (LinkPolicy("autopilot", "autopilot"), LinkPolicy("ground", "gcs"), LinkPolicy("tablet", "gcs"))
        signing = SigningPolicy(key=KEY, timestamp=START) if has_key else None
        self.node = Node(links, WANTED, signing=signing)
        self.node.adopt(1, 1)
        self.vehicle, self.station, self.radio = Wire(1, 1), Wire(255, 190), Wire(51, 68)
        if has_key:
            for wire in (self.vehicle, self.station):
                wire.mav.signing.secret_key, wire.mav.signing.timestamp = KEY, START
                wire.mav.signing.sign_outgoing = True
        self.tick = 0

    def fly(self, seconds: float, txbuf: int | None) -> dict[tuple[str, int], int]:
        """Frames by (link, message id) that left: 50 attitudes a second, and once a second a heartbeat, a command of
        the station and its answer.
        """
        left: dict[str, bytes] = {"autopilot": b"", "ground": b"", "tablet": b""}
        for _ in range(round(seconds * NS_PER_S / TICK_NS)):
            self.tick += 1
            vehicle, station = self.vehicle.attitude(20 * self.tick), b""
            if self.tick % 50 == 0:
                vehicle += self.vehicle.heartbeat() + self.vehicle.frame("COMMAND_ACK", 400, 0, 0, 0, 255, 190)
                station = self.station.heartbeat(dialect.MAV_TYPE_GCS, 8) + self.station.command(1, 1)
            if txbuf is not None:
                station += self.radio.frame("RADIO_STATUS", 1, 1, txbuf, 0, 0, 0, 0)
            now = HostNs(1000 * NS_PER_S + self.tick * TICK_NS)
            for link, data in (("ground", station), ("autopilot", vehicle)):
                for name, frame in self.node.receive(link, data, now).forwards if data else ():
                    left[name] += frame
        counts: dict[tuple[str, int], int] = {}
        for name, data in left.items():
            for frame in Scanner().feed(data):
                counts[name, frame.msgid] = counts.get((name, frame.msgid), 0) + 1
        return counts


@pytest.mark.parametrize("has_key", [False, True], ids=["without a key", "with a key"])
def test_forged_reports_slow_telemetry_of_their_link_alone_and_not_for_good(has_key):
    net = Net(has_key=has_key)
    net.fly(2.0, None)
    forged = net.fly(20.0, 0)
    assert forged["autopilot", dialect.MAVLINK_MSG_ID_COMMAND_LONG] == 20
    assert not {msgid for name, msgid in forged if name == "autopilot"} & {
        dialect.MAVLINK_MSG_ID_RADIO_STATUS,
        dialect.MAVLINK_MSG_ID_RADIO,
    }
    assert forged["ground", dialect.MAVLINK_MSG_ID_HEARTBEAT] == 20
    assert forged["ground", dialect.MAVLINK_MSG_ID_COMMAND_ACK] == 20
    assert 20 <= forged["ground", dialect.MAVLINK_MSG_ID_ATTITUDE] < 400
    assert forged["tablet", dialect.MAVLINK_MSG_ID_ATTITUDE] == 1000
    net.fly(12.0, None)
    assert net.fly(10.0, None)["ground", dialect.MAVLINK_MSG_ID_ATTITUDE] == 500
