"""Finds whole MAVLink frames in the bytes of one link.

A frame is accepted when

- its start byte is 0xFE (MAVLink 1) or 0xFD (MAVLink 2), and its incompatibility flags request at most a signature; and
- its message id is known and its checksum is right; or
- its message id is unknown, so that its checksum cannot be checked, and another start byte follows it (or the end of
  a datagram). If bytes had to be skipped just before it, a known frame with a right checksum that begins inside it
  takes precedence: noise that looks like a long unknown frame must not swallow a good one.

After a failure the scan continues at the second byte, so that no good frame is lost next to a corrupted one. The result
depends on the bytes alone, never on their division into chunks. The decision is postponed only if more bytes could
change it, and then at most two frames of the greatest length are kept: 2 x 280 bytes.
"""

from __future__ import annotations

import re
from enum import Enum
from struct import Struct
from typing import Final

from fwav_companion.mavlink.wire.definitions import DEFINITIONS
from fwav_companion.mavlink.wire.frames import (
    FLAG_SIGNED,
    HEADER_V1,
    HEADER_V2,
    MARKER_V2,
    SIGNATURE_LENGTH,
    Flow,
    RawFrame,
    checksum,
)

_SHORTEST_V1: Final = HEADER_V1 + 2
_SHORTEST_V2: Final = HEADER_V2 + 2

MAX_FLOWS: Final = 4096
"""Flows remembered on one link: 250 vehicles with sixteen messages each. Beyond it the table starts over."""

_MARKERS: Final = b"\xfd\xfe"
_next_marker: Final = re.compile(b"[\xfd\xfe]").search


# Incompat flags, seq, identity (system, component, message id) and checksum, by length of payload: one read is a third
# faster than four.
_read_v2: Final = tuple(Struct(f"<xxBxB5s{length}xH").unpack_from for length in range(256))


class _Nothing(Enum):
    """Reason why no frame begins at a byte."""

    HERE = "no frame"
    YET = "more bytes are needed to tell"
    BAD_CHECKSUM = "its checksum is wrong"
    NOT_UNDERSTOOD = "it asks for what we do not know"


class Scanner:
    """Finds the frames in the bytes of one link."""

    def __init__(self, *, datagrams: bool = False) -> None:
        """Start with an empty buffer. ``datagrams``: every chunk begins and usually ends with a frame, as over UDP."""
        self.bad_checksums = 0
        """Frames of known ids with a wrong checksum, where a frame was due: noise elsewhere is not counted."""
        self.not_understood = 0
        """Frames with incompatibility flags other than the signature's, where a frame was due."""
        self.skipped_bytes = 0
        """Bytes outside any frame."""
        self.undecided = False
        """Whether a whole frame of an unknown id waits for the next bytes: see :meth:`settle`."""
        self._flows: dict[bytes, Flow] = {}
        """Flows of known ids, by system, component and message id as in a MAVLink 2 header."""
        self._datagrams = datagrams
        self._pending = b""
        self._due = datagrams
        """Whether the next byte follows a frame and should begin one."""
        self._clear_to = 0
        """Index in the pending bytes below which no known frame begins, except at the first byte."""

    def feed(self, data: bytes) -> list[RawFrame]:
        """Return the frames that are complete with these bytes, in order."""
        pending = self._pending
        if not self._datagrams:
            return self._scan(pending + data if pending else data, at_end=False)
        frames: list[RawFrame] = []
        if pending and self._begins_with_known_frame(data):
            frames = self._give_up(pending)
            pending = b""
        self._due = self._due or not pending
        return frames + self._scan(pending + data, at_end=True)

    def reset(self) -> None:
        """Drop the pending bytes: the link was opened again, and they will not be continued."""
        self._pending = b""
        self._due = self._datagrams
        self._clear_to = 0
        self.undecided = False

    def settle(self) -> list[RawFrame]:
        """Return the frames that are accepted if no byte follows: for a stream that has been quiet for a while."""
        return self._scan(self._pending, at_end=True)

    def _give_up(self, pending: bytes) -> list[RawFrame]:
        """Return the whole frames behind one that was cut off with its datagram and will not be continued."""
        frames: list[RawFrame] = []
        while pending:
            marker = _next_marker(pending, 1)
            start = marker.start() if marker else len(pending)
            self.skipped_bytes += start
            self._due, self._clear_to = False, 0
            frames += self._scan(pending[start:], at_end=True)
            pending = self._pending
        return frames

    def _scan(self, buffer: bytes, *, at_end: bool) -> list[RawFrame]:
        frames: list[RawFrame] = []
        self.undecided = False
        flows = self._flows
        size = len(buffer)
        last_header = size - _SHORTEST_V2
        position = 0
        frame_end = 0 if self._due else -1
        while position < size:
            # The common case, inline because every frame of the relay passes here: MAVLink 2, unsigned, flow known.
            if buffer[position] == MARKER_V2:
                if position > last_header:
                    break
                length = buffer[position + 1]
                end = position + _SHORTEST_V2 + length
                if end <= size:
                    flags, seq, identity, received = _read_v2[length](buffer, position)
                    flow = flows.get(identity)
                    if (
                        flow is not None
                        and flags == 0
                        and checksum(buffer[position + 1 : end - 2] + flow.crc_byte) == received
                    ):
                        frames.append(RawFrame(buffer[position:end], flow, seq))
                        position = frame_end = end
                        continue
                elif buffer[position + 2] <= FLAG_SIGNED:
                    break
            self._due = position == frame_end
            advanced = self._step(buffer, position, frames, at_end)
            if advanced == position:
                break
            position = advanced
            frame_end = position if self._due else -1
        self._due = position == frame_end
        self._pending = buffer[position:]
        if self._clear_to:
            self._clear_to = max(0, self._clear_to - position)
        return frames

    def _step(self, buffer: bytes, position: int, frames: list[RawFrame], at_end: bool) -> int:
        """Take one frame or skip to the next start byte. Returns the new position; the old one if more bytes are
        needed.
        """
        found = self._frame_at(buffer, position)
        if isinstance(found, RawFrame) and found.definition is None:
            found = self._judge_unknown(buffer, position, found, at_end)
        if isinstance(found, RawFrame):
            frames.append(found)
            self._due = True
            return position + len(found.data)
        if found is _Nothing.YET:
            return position
        self._count(found)
        marker = _next_marker(buffer, position + 1)
        advanced = marker.start() if marker else len(buffer)
        self.skipped_bytes += advanced - position
        self._due = False
        return advanced

    def _judge_unknown(self, buffer: bytes, position: int, frame: RawFrame, at_end: bool) -> RawFrame | _Nothing:
        end = position + len(frame.data)
        if end == len(buffer):
            if not at_end:
                self.undecided = True
                return _Nothing.YET
        elif buffer[end] not in _MARKERS:
            return _Nothing.HERE
        return frame if self._due else self._unless_known_inside(buffer, position, frame, at_end)

    def _unless_known_inside(self, buffer: bytes, position: int, frame: RawFrame, at_end: bool) -> RawFrame | _Nothing:
        """Return the unknown frame, unless a known one with a right checksum begins inside it."""
        end = position + len(frame.data)
        start = max(position + 1, self._clear_to)
        while marker := _next_marker(buffer, start, end):
            inside = self._frame_at(buffer, marker.start())
            if isinstance(inside, RawFrame) and inside.definition is not None:
                return _Nothing.HERE
            if inside is _Nothing.YET and not at_end and _may_be_known(buffer, marker.start()):
                return _Nothing.YET
            start = self._clear_to = marker.start() + 1
        return frame

    def _count(self, nothing: _Nothing) -> None:
        if not self._due:
            return
        if nothing is _Nothing.BAD_CHECKSUM:
            self.bad_checksums += 1
        elif nothing is _Nothing.NOT_UNDERSTOOD:
            self.not_understood += 1

    def _frame_at(self, buffer: bytes, position: int) -> RawFrame | _Nothing:
        """Return the frame that begins here by its own header and, for a known id, checksum."""
        left = len(buffer) - position
        marker = buffer[position]
        if marker not in _MARKERS:
            return _Nothing.HERE
        if left < (_SHORTEST_V2 if marker == MARKER_V2 else _SHORTEST_V1):
            return _Nothing.YET
        if marker == MARKER_V2:
            if buffer[position + 2] > FLAG_SIGNED:
                return _Nothing.NOT_UNDERSTOOD
            body_end = position + HEADER_V2 + buffer[position + 1]
            end = body_end + 2 + SIGNATURE_LENGTH * buffer[position + 2]
            identity = buffer[position + 5 : position + HEADER_V2]
            seq = buffer[position + 4]
        else:
            body_end = position + HEADER_V1 + buffer[position + 1]
            end = body_end + 2
            identity = buffer[position + 3 : position + HEADER_V1] + b"\0\0"
            seq = buffer[position + 2]
        if end > len(buffer):
            return _Nothing.YET
        flow = self._flows.get(identity) or self._new_flow(identity)
        if flow.definition is not None:
            received = int.from_bytes(buffer[body_end : body_end + 2], "little")
            if checksum(buffer[position + 1 : body_end] + flow.crc_byte) != received:
                return _Nothing.BAD_CHECKSUM
            self._remember(identity, flow)
        return RawFrame(buffer[position:end], flow, seq)

    def _new_flow(self, identity: bytes) -> Flow:
        msgid = int.from_bytes(identity[2:], "little")
        return Flow(identity[0], identity[1], msgid, DEFINITIONS.get(msgid))

    def _remember(self, identity: bytes, flow: Flow) -> None:
        if len(self._flows) >= MAX_FLOWS:
            self._flows.clear()
        self._flows[identity] = flow

    def _begins_with_known_frame(self, data: bytes) -> bool:
        found = self._frame_at(data, 0) if data else _Nothing.YET
        return isinstance(found, RawFrame) and found.known


def _may_be_known(buffer: bytes, position: int) -> bool:
    """Return whether the bytes here begin a frame of a known message id, as far as they have arrived."""
    if buffer[position] == MARKER_V2:
        msgid = buffer[position + 7 : position + HEADER_V2]
        return len(msgid) < 3 or int.from_bytes(msgid, "little") in DEFINITIONS
    return len(buffer) - position < HEADER_V1 or buffer[position + 5] in DEFINITIONS
