"""Finds whole MAVLink frames in the bytes of one link.

A frame is accepted when

- its start byte is 0xFE (MAVLink 1) or 0xFD (MAVLink 2), and its incompatibility flags request at most a signature; and
- its message id is known and its checksum is right; or
- its message id is unknown, so that its checksum cannot be checked, and another start byte follows it (or the end of
  a datagram). If bytes had to be skipped just before it, a known frame with a right checksum that begins inside it
  takes precedence: noise that looks like a long unknown frame must not swallow a good one.

After a failure the scan continues at the second byte, so that no good frame is lost next to a corrupted one. The result
depends on the bytes alone, never on their division into chunks, unless bytes are shed. The decision is postponed only
if more bytes could change it, and then at most two frames of the greatest length are kept: 2 x 280 bytes.

The work is bounded for any bytes. A frame of a known flow costs 0.6 us, a byte without a start byte 1 ns. Every other
start byte is a *trial* of about 2 us: a header that does not fit its message, a wrong checksum, a frame of a new flow.
A genuine stream costs 15 ns a byte, so 0xFE alone would cost 130 times as much. Each received byte therefore earns
TRIALS_PER_KIB / 1024 trials, up to BURST. Once they are used up, the next needed trial sheds bytes instead, and the
shed bytes are counted: up to the end of the chunk, the scan only searches MAVLink 2 headers of known flows, by one
regular expression (7 ns a byte of 0xFD) and the table. These headers have RESERVE trials of their own, which other
trials cannot use, so that the frames of a vehicle between start bytes with false lengths are found.

Earned trials cost 2 us x 18 / 1024 = 35 ns a byte, 2.4 times the genuine cost; with the cost of valid frames between
them, the sum stays below 4 times (tests/benchmarks/adversary.py). Random bytes have 8 start bytes in a KiB, and a
corrupted frame 1.3: noise of a wrong baud rate, and a stream with half its frames corrupted, shed nothing. Whole
frames of known flows do not need a trial. Neither does a known frame at the beginning of a datagram, whose reception
costs more than a trial: otherwise a sender that is first heard while others flood the port would stay unheard.
"""

from __future__ import annotations

import re
from struct import Struct
from typing import Final

from fwav_companion.mavlink.wire.flow_table import MAX_FLOWS, FlowTable
from fwav_companion.mavlink.wire.frame_reader import (
    MARKERS,
    SHORTEST_V1,
    SHORTEST_V2,
    NoFrameHere,
    may_be_known,
    next_marker,
    read_frame,
)
from fwav_companion.mavlink.wire.frames import (
    FLAG_SIGNED,
    HEADER_V1,
    HEADER_V2,
    MARKER_V1,
    MARKER_V2,
    RawFrame,
    checksum,
)

TRIALS_PER_KIB: Final = 18
"""Trials that received bytes earn."""
_TRIAL: Final = 1024 // TRIALS_PER_KIB
"""Cost of a trial in the unit of the credit, a byte."""
BURST: Final = 256
"""Most trials that are saved up, half a millisecond of work: the first frames of 250 flows at once."""
RESERVE: Final = 64
"""Trials in addition to BURST for headers of known flows in bytes that are shed."""
_LOOKUP: Final = 8
"""Cost of looking up a header of a known flow, 0.3 us, in the unit of the credit."""
SHORT: Final = 32
"""Length of a frame of a known flow below which it counts as a trial unless it is the common case: it takes 1.5 us."""
_LEAST_V1: Final = 16
"""Length of the MAVLink 1 frames that are the common case: a heartbeat has 17 bytes."""

_next_header: Final = re.compile(rb"(?s)\xfd.[\x00\x01]\x00").search
"""Search for a MAVLink 2 header: start byte, length, incompatibility flags, compatibility flags (no bit is defined)."""
_NEXT_HEADER_BYTES: Final = 4
# Incompat flags, seq, identity (system, component, message id) and checksum, by length of payload: one read is a third
# faster than four.
_read_v2: Final = tuple(Struct(f"<xxBxB5s{length}xH").unpack_from for length in range(256))


class Scanner:
    """Finds the frames in the bytes of one link."""

    def __init__(self, *, datagrams: bool = False, max_flows: int = MAX_FLOWS) -> None:
        """Start with an empty buffer. ``datagrams``: every chunk begins and usually ends with a frame, as over UDP."""
        self.bad_checksums = 0
        """Frames of known ids with a wrong checksum, where a frame was due: noise elsewhere is not counted."""
        self.not_understood = 0
        """Frames with incompatibility flags other than the signature's, where a frame was due."""
        self.skipped_bytes = 0
        """Bytes outside any frame."""
        self.shed_bytes = 0
        """Number of skipped bytes that were not examined, because the link had used up its trials."""
        self.undecided = False
        """Whether a whole frame of an unknown id waits for the next bytes: see :meth:`settle`."""
        self._credit = (BURST + RESERVE) * _TRIAL
        self._floor = RESERVE * _TRIAL
        """Credit that trials leave: 0 from the first byte that is shed to the end of the chunk."""
        self._flows = FlowTable(max_flows)
        self._datagrams = datagrams
        self._pending = b""
        self._due = datagrams
        """Whether the next byte follows a frame and should begin one."""
        self._clear_to = 0
        """Index in the pending bytes below which no known frame begins, except at the first byte."""

    def feed(self, data: bytes) -> list[RawFrame]:
        """Return the frames that are complete with these bytes, in order."""
        pending = self._pending
        self._credit = min(self._credit + len(data), (BURST + RESERVE) * _TRIAL)
        self._floor = RESERVE * _TRIAL
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
            if not self._pay():
                self._drop(len(pending))
                break
            marker = next_marker(pending, 1)
            start = marker.start() if marker else len(pending)
            self.skipped_bytes += start
            self._due, self._clear_to = False, 0
            frames += self._scan(pending[start:], at_end=True)
            pending = self._pending
        return frames

    def _scan(self, buffer: bytes, *, at_end: bool) -> list[RawFrame]:
        frames: list[RawFrame] = []
        self.undecided = False
        flows = self._flows.known
        size = len(buffer)
        last_header = size - SHORTEST_V2
        position = 0
        frame_end = 0 if self._due else -1
        while position < size:
            # The common case, inline because every frame of the relay passes here: MAVLink 2, unsigned, flow known.
            if buffer[position] == MARKER_V2:
                if position > last_header:
                    break
                length = buffer[position + 1]
                end = position + SHORTEST_V2 + length
                if end <= size:
                    flags, seq, identity, received = _read_v2[length](buffer, position)
                    flow = flows.get(identity)
                    if (
                        flow is not None
                        and flags == 0
                        and checksum(buffer[position + 1 : end - 2] + flow.crc_byte) == received
                    ):
                        flow.used = True
                        frames.append(RawFrame(buffer[position:end], flow, seq))
                        position = frame_end = end
                        continue
                elif buffer[position + 2] <= FLAG_SIGNED:
                    break
            elif buffer[position] == MARKER_V1:
                old = self._common_v1(buffer, position)
                if old is not None:
                    frames.append(old)
                    position = frame_end = position + len(old.data)
                    continue
            self._due = position == frame_end
            advanced = self._step(buffer, position, frames, at_end)
            if advanced == position:
                break
            position = advanced
            frame_end = position if self._due else -1
        self._due = position == frame_end
        self._pending = buffer[position:]
        self._clear_to = max(0, self._clear_to - position)
        return frames

    def _common_v1(self, buffer: bytes, position: int) -> RawFrame | None:
        """Return the MAVLink 1 frame of a known flow that begins here; None for any other case."""
        if len(buffer) - position < _LEAST_V1:
            return None
        length, seq = buffer[position + 1], buffer[position + 2]
        end = position + SHORTEST_V1 + length
        flow = self._flows.known.get(buffer[position + 3 : position + HEADER_V1] + b"\0\0")
        if flow is None or end > len(buffer) or length < _LEAST_V1 - SHORTEST_V1:
            return None
        received = buffer[end - 2] | buffer[end - 1] << 8
        if flow.definition is None or checksum(buffer[position + 1 : end - 2] + flow.crc_byte) != received:
            return None
        flow.used = True
        return RawFrame(buffer[position:end], flow, seq)

    def _pay(self) -> bool:
        """Pay for a trial. Returns False if the link has none left."""
        if self._credit < self._floor + _TRIAL:
            return False
        self._credit -= _TRIAL
        return True

    def _shed(self, buffer: bytes, position: int) -> int:
        """Skip to the next header of a known flow, or to the end. A false header costs one of the reserved trials."""
        is_free, self._floor = self._floor > 0, 0
        found = self._known_header(buffer, position + 1) if is_free or self._pay() else len(buffer)
        self._drop(found - position)
        return found

    def _known_header(self, buffer: bytes, start: int) -> int:
        """Return the start of a MAVLink 2 header of a known flow, or of one cut by the buffer's end; else the end."""
        end = len(buffer)
        while header := _next_header(buffer, start):
            if self._credit < _LOOKUP:
                return end
            self._credit -= _LOOKUP
            start = header.start()
            if end - start < SHORTEST_V2 or buffer[start + 5 : start + HEADER_V2] in self._flows.known:
                return start
            start += 1
        cut = buffer.find(MARKER_V2, max(start, end - _NEXT_HEADER_BYTES + 1))
        return end if cut < 0 else cut

    def _drop(self, count: int) -> None:
        self.skipped_bytes += count
        self.shed_bytes += count
        self._due, self._clear_to = False, 0

    def _step(self, buffer: bytes, position: int, frames: list[RawFrame], at_end: bool) -> int:
        """Read one frame or skip to the next start byte. Returns the new position; the old one if more bytes are
        needed.
        """
        found = read_frame(buffer, position, self._flows)
        if isinstance(found, RawFrame) and found.definition is None:
            found = self._judge_unknown(buffer, position, found, at_end)
        if isinstance(found, RawFrame):
            if not self._accept(found, begins_datagram=self._datagrams and position == 0):
                return self._shed(buffer, position)
            frames.append(found)
            self._due = True
            return position + len(found.data)
        if found is NoFrameHere.UNDECIDED:
            return position
        self._count(found)
        if not self._floor or not self._pay():
            return self._shed(buffer, position)
        marker = next_marker(buffer, position + 1)
        advanced = marker.start() if marker else len(buffer)
        self.skipped_bytes += advanced - position
        self._due = False
        return advanced

    def _judge_unknown(self, buffer: bytes, position: int, frame: RawFrame, at_end: bool) -> RawFrame | NoFrameHere:
        end = position + len(frame.data)
        if end == len(buffer):
            if not at_end:
                self.undecided = True
                return NoFrameHere.UNDECIDED
        elif buffer[end] not in MARKERS:
            return NoFrameHere.NOTHING
        return frame if self._due else self._unless_known_inside(buffer, position, frame, at_end)

    def _unless_known_inside(
        self, buffer: bytes, position: int, frame: RawFrame, at_end: bool
    ) -> RawFrame | NoFrameHere:
        """Return the unknown frame, unless a known one with a right checksum begins inside it."""
        end = position + len(frame.data)
        start = max(position + 1, self._clear_to)
        while marker := next_marker(buffer, start, end):
            if not self._pay():
                return NoFrameHere.NOTHING
            inside = read_frame(buffer, marker.start(), self._flows)
            if isinstance(inside, RawFrame) and inside.definition is not None:
                return NoFrameHere.NOTHING
            if inside is NoFrameHere.UNDECIDED and not at_end and may_be_known(buffer, marker.start()):
                return NoFrameHere.UNDECIDED
            start = self._clear_to = marker.start() + 1
        return frame

    def _count(self, nothing: NoFrameHere) -> None:
        if not self._due:
            return
        if nothing is NoFrameHere.BAD_CHECKSUM:
            self.bad_checksums += 1
        elif nothing is NoFrameHere.NOT_UNDERSTOOD:
            self.not_understood += 1

    def _accept(self, frame: RawFrame, *, begins_datagram: bool) -> bool:
        """Remember the flow of a frame that is not the common case, which is a trial if the flow is new or the frame is
        short. Returns False if the link has no trial left.
        """
        if frame.flow.remembered:
            frame.flow.used = True
            return len(frame.data) >= SHORT or self._pay()
        if not (begins_datagram and frame.known) and not self._pay():
            return False
        self._flows.remember(frame)
        return True

    def _begins_with_known_frame(self, data: bytes) -> bool:
        found = read_frame(data, 0, self._flows) if data else NoFrameHere.UNDECIDED
        return isinstance(found, RawFrame) and found.known
