"""Remembers the flows of one link: the pairs of sender and message that were received before.

The scanner handles frames of known flows fastest. Strangers can invent flows, so the table is bounded.
"""

from __future__ import annotations

from typing import Final

from fwav_companion.mavlink.wire.definitions import DEFINITIONS
from fwav_companion.mavlink.wire.frames import HEADER_V1, HEADER_V2, MARKER_V2, Flow, RawFrame

MAX_FLOWS: Final = 4096
"""Most flows on all links together: 250 vehicles with sixteen messages each, 250 bytes a flow. Beyond a link's share,
unused flows are forgotten."""


class FlowTable:
    """The flows of one link by identity: system, component and message id as in a MAVLink 2 header."""

    def __init__(self, max_flows: int = MAX_FLOWS) -> None:
        """Start with an empty table."""
        self.known: dict[bytes, Flow] = {}
        """Flows of known message ids, in order of their last chance."""
        self._unknown: dict[bytes, Flow] = {}
        """Flows of unknown ids, whose checksums cannot be checked."""
        self._max_flows = max_flows

    def __len__(self) -> int:
        """Return the number of remembered flows."""
        return len(self.known) + len(self._unknown)

    def find(self, identity: bytes) -> Flow:
        """Return the flow of an identity; a new one, which is not remembered yet, if there is none."""
        return self.known.get(identity) or self._unknown.get(identity) or _new_flow(identity)

    def remember(self, frame: RawFrame) -> None:
        """Add the frame's flow. A full table forgets one first."""
        flows = self.known if frame.known else self._unknown
        if len(self.known) + len(self._unknown) >= self._max_flows:
            _forget_one(flows or self.known)
        data = frame.data
        flows[data[5:HEADER_V2] if data[0] == MARKER_V2 else data[3:HEADER_V1] + b"\0\0"] = frame.flow
        frame.flow.remembered = True


def _new_flow(identity: bytes) -> Flow:
    msgid = int.from_bytes(identity[2:], "little")
    return Flow(identity[0], identity[1], msgid, DEFINITIONS.get(msgid))


def _forget_one(flows: dict[bytes, Flow]) -> None:
    """Forget the first flow that was not used since its last chance; used ones get another (the clock algorithm).

    Each paid trial forgets one. A whole round of the table needs a frame of every flow before it.
    """
    while True:
        identity, flow = next(iter(flows.items()))
        del flows[identity]
        if not flow.used:
            flow.remembered = False
            return
        flow.used = False
        flows[identity] = flow
