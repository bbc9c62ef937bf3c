"""A routing node without any socket, its links, and a vehicle with a ground station behind it."""

from __future__ import annotations

from mavlink_wire import Wire, dialect

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.router.node import LinkPolicy, Node

AUTOPILOT = LinkPolicy("autopilot", "autopilot")
SECOND = LinkPolicy("second", "autopilot")
GROUND = LinkPolicy("ground", "gcs")
ARM, GET_MESSAGE_INTERVAL, SET_MESSAGE_INTERVAL, REQUEST_MESSAGE = 400, 510, 511, 512
TABLET = LinkPolicy("tablet", "gcs")


class Net:
    """A node whose links are fed by hand, a millisecond apart."""

    def __init__(self, *links: LinkPolicy, wanted: tuple[str, ...] = (), system: int = 1) -> None:
        self.node = Node(links or (AUTOPILOT, GROUND, TABLET), wanted)
        self.node.adopt(system)
        self.now = HostNs(NS_PER_S)

    def feed(self, link: str, *frames: bytes) -> list[tuple[str, bytes]]:
        self.now = HostNs(self.now + NS_PER_MS)
        received = self.node.receive(link, b"".join(frames), self.now)
        return received.forwards

    def links_of(self, link: str, frame: bytes) -> list[str]:
        """The links that one frame is sent to; that it is unchanged is asserted here for all tests."""
        forwards = self.feed(link, frame)
        assert all(data == frame for _, data in forwards)
        return [name for name, _ in forwards]

    def wait(self, ns: int) -> None:
        self.now = HostNs(self.now + ns)


def vehicle_and_ground(net: Net) -> tuple[Wire, Wire]:
    vehicle, ground = Wire(1, 1), Wire(255, 190)
    net.feed("autopilot", vehicle.heartbeat())
    net.feed("ground", ground.heartbeat(dialect.MAV_TYPE_GCS, 8))
    return vehicle, ground
