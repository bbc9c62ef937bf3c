"""Decides which senders are accepted on a link, and which of its messages are read as the vehicle's state.

- Frames with the autopilot's ids are accepted on autopilot links alone. On other links they are not forwarded and teach
 no route: a station forwards the autopilot's own stream back, or the sender is another vehicle or a forgery.
- A frame with the ids of a component of ours is an echo if we sent these bytes lately. Otherwise a second program uses
 our ids; its frames go to the autopilot only, so that it keeps working until its ids are changed.
- On a link of ground stations no sender with our system id, or the vehicle's, reports the vehicle's state.
"""

from __future__ import annotations

from typing import Final

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.router.duplicates import Duplicates
from fwav_companion.mavlink.router.link_limiter import LEAST_SHARE, STATIONS_SHARE
from fwav_companion.mavlink.router.link_load import StreamKey
from fwav_companion.mavlink.router.own_frames import OwnFrames
from fwav_companion.mavlink.router.peers import Peer
from fwav_companion.mavlink.router.routing import Port, Router
from fwav_companion.mavlink.wire.definitions import BY_NAME
from fwav_companion.mavlink.wire.enums import MAV_AUTOPILOT_INVALID
from fwav_companion.mavlink.wire.frames import RawFrame

_HEARTBEAT: Final = BY_NAME["HEARTBEAT"].msgid
_AUTOPILOT_OFFSET: Final = BY_NAME["HEARTBEAT"].fields["autopilot"].offset
SETTLING_NS: Final = 10 * NS_PER_S
"""Time after the start in which a frame with our ids counts as an echo, because an earlier run may have sent it."""
UNVERIFIED: Final = 1 << 16
"""Bit of a stream's sender: forged frames do not use up the rate of the genuine sender."""
_NO_STATE: Final = frozenset(
    BY_NAME[name].msgid for name in ("HEARTBEAT", "TIMESYNC", "PING", "COMMAND_LONG", "COMMAND_INT")
)
"""Messages without the vehicle's state: presence, and requests to us."""


class Acceptance:
    """Judges senders and messages by the role of the link that they arrive on."""

    def __init__(self, router: Router, duplicates: Duplicates, own_frames: OwnFrames) -> None:
        self._router = router
        self._duplicates = duplicates
        self._own_frames = own_frames
        self._settled_ns: HostNs | None = None

    def new_peer(self, port: Port, frame: RawFrame, now: HostNs) -> Peer | None:
        """Add a sender heard for the first time on the link. Returns None if it is not accepted on this link, or if the
        frame is a copy that may be an echo.
        """
        router = self._router
        if self._settled_ns is None:
            self._settled_ns = HostNs(now + SETTLING_NS)
        if router.is_own(frame):
            if self._is_echo(frame, now):
                port.echoes += 1
            else:
                port.id_conflict += 1
            return None
        if not port.is_autopilot and router.is_autopilot(frame):
            port.own_ids_on_gcs += 1
            return None
        first = router.ports[self._duplicates.came_first_by(frame.data, port.index)]
        if first is not port and not router.are_two_ways(first, port, frame):
            port.duplicates += 1
            return None
        return router.learn(port, frame, now)

    def _is_echo(self, frame: RawFrame, now: HostNs) -> bool:
        settled = self._settled_ns is not None and now >= self._settled_ns
        return not settled or frame.data in self._own_frames

    def forwards_of_untrusted(self, port: Port, frame: RawFrame, now: HostNs) -> list[tuple[str, bytes]]:
        """Return (link, frame) for a frame whose sender is not verified: it teaches no route, does not go to the
        vehicle, and takes little of the bytes that a link may send.
        """
        router = self._router
        if router.is_own(frame):
            return []
        if not port.is_autopilot and router.is_autopilot(frame):
            port.own_ids_on_gcs += 1
            return []
        if self._duplicates.came_first_by(frame.data, port.index) != port.index:
            port.duplicates += 1
            return []
        outs = router.route(port, frame, frame.target_system, frame.target_component)
        outs = router.on_ground(port, outs)
        stream, size = (frame.msgid, UNVERIFIED | frame.system << 8 | frame.component, frame.instance), len(frame.data)
        outs = self.granted(outs, stream, size, now, share=LEAST_SHARE)
        return [(out.name, frame.data) for out in outs if out.limiter.passes(stream, size, now)]

    def granted(
        self, outs: tuple[Port, ...], stream: StreamKey, size: int, now: HostNs, *, share: float = STATIONS_SHARE
    ) -> tuple[Port, ...]:
        """Return the links that take a frame of a sender that is not verified: they grant all such frames together a
        share of their bytes, if these are limited; an autopilot's takes all.
        """
        return tuple(out for out in outs if out.is_autopilot or out.limiter.grants(stream, size, share, now))

    def is_second_copy(self, port: Port, frame: RawFrame) -> bool:
        """Return whether the frame arrived lately by another link."""
        return self._duplicates.came_first_by(frame.data, port.index) != port.index

    def is_genuine(self, port: Port, frame: RawFrame) -> bool:
        """Return whether a frame of the vehicle's links counts though the same bytes came first on a station's link.

        Its sender is heard here and not there: those bytes were forged in advance. A heartbeat has 256 variants.
        """
        first = self._router.ports[self._duplicates.came_first_by(frame.data, port.index)]
        sender = frame.system << 8 | frame.component
        return first.is_gcs and not port.is_gcs and sender in port.peers and sender not in first.peers

    def forwards_of_refused(self, port: Port, frame: RawFrame, now: HostNs) -> list[tuple[str, bytes]]:
        """Return (link, frame) for a frame that taught no route: to an autopilot, from a second program with our
        ids.
        """
        if not self._router.is_own(frame) or self._is_echo(frame, now):
            return []
        if self._duplicates.came_first_by(frame.data, port.index) != port.index:
            return []
        ways = self._router.route(port, frame, frame.target_system, frame.target_component)
        return [(out.name, frame.data) for out in ways if out.is_autopilot]

    def is_believed(self, port: Port, frame: RawFrame) -> bool:
        """Return whether a message of a known sender may be read on this link."""
        if port.is_autopilot:
            return True
        msgid = frame.msgid
        if msgid == _HEARTBEAT:
            return frame.payload_byte(_AUTOPILOT_OFFSET) == MAV_AUTOPILOT_INVALID
        # The vehicle's id is not ours where its autopilot sends with system 0.
        of_vehicle = frame.system == self._router.system or frame.system == self._router.vehicle
        return not (port.is_gcs and of_vehicle and msgid not in _NO_STATE)
