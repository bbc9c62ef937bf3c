"""SHELL: the messages of an MCAP file in chunks with indices, byte by byte as the mcap library writes them.

The library's records are used for all that is rare. What is written for each message is packed here in two calls, where
the library takes forty: it would be more than half of the time of an export. The extra ``mcap``.
"""

from __future__ import annotations

import zlib
from array import array
from collections import defaultdict
from collections.abc import Mapping
from struct import Struct, pack
from sys import byteorder
from typing import TYPE_CHECKING, BinaryIO, Final

if TYPE_CHECKING:
    from mcap.records import Channel, ChunkIndex, McapRecord, MetadataIndex, Schema, Statistics

MAGIC: Final = b"\x89MCAP0\r\n"
FOOTER, SCHEMA, CHANNEL, MESSAGE, MESSAGE_INDEX, CHUNK_INDEX = 0x02, 0x03, 0x04, 0x05, 0x07, 0x08
ATTACHMENT_INDEX, STATISTICS, METADATA_INDEX = 0x0A, 0x0B, 0x0D
"""Opcodes of records."""
MESSAGE_HEAD: Final = Struct("<BQHIQQ")
"""Opcode, length of what follows, channel, sequence, log time, publish time."""
MESSAGE_BYTES: Final = MESSAGE_HEAD.size - 9
"""Bytes of these fields that the length counts: without opcode and length."""
INDEX_HEAD: Final = Struct("<BQHI")
"""Opcode, length of what follows, channel, bytes of the entries."""
FOOTER_BYTES: Final = 20


class ChunkedFile:
    """An MCAP file that grows by whole chunks; what is kept is one chunk and the index of the others."""

    def __init__(self, file: BinaryIO, chunk_bytes: int, library: str) -> None:
        from mcap import records

        self._records = records
        self._file, self._chunk_bytes = file, chunk_bytes
        self._at = 0
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunk = bytearray()
        self._entries: defaultdict[int, array[int]] = defaultdict(lambda: array("Q"))
        """By channel: log time and place in the chunk of each message, in turn."""
        self._chunks: list[ChunkIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: defaultdict[int, int] = defaultdict(int)
        self._first_ns = self._last_ns = 0
        self._span_ns: tuple[int, int] | None = None
        """First and last log time in the chunk."""
        self._write(MAGIC)
        self._write(_bytes_of(self._records.Header("", library)))

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Add a schema; returns its number."""
        number = len(self._schemas) + 1
        self._schemas.append(self._records.Schema(id=number, data=data, encoding=encoding, name=name))
        self._chunk += _bytes_of(self._schemas[-1])
        return number

    def add_channel(self, topic: str, encoding: str, schema: int) -> int:
        """Add a channel; returns its number."""
        number = len(self._channels) + 1
        channel = self._records.Channel(
            id=number, topic=topic, message_encoding=encoding, metadata={}, schema_id=schema
        )
        self._channels.append(channel)
        self._chunk += _bytes_of(channel)
        return number

    def add_metadata(self, name: str, content: Mapping[str, str]) -> None:
        """Add metadata about the whole file."""
        data = _bytes_of(self._records.Metadata(name=name, metadata=dict(content)))
        self._metadata.append(self._records.MetadataIndex(offset=self._at, length=len(data), name=name))
        self._write(data)

    def add_message(self, channel: int, at_ns: int, data: bytes, sequence: int) -> None:
        """Add a message. Its log time and publish time are both ``at_ns``."""
        chunk, entries = self._chunk, self._entries[channel]
        entries.append(at_ns)
        entries.append(len(chunk))
        chunk += MESSAGE_HEAD.pack(MESSAGE, MESSAGE_BYTES + len(data), channel, sequence, at_ns, at_ns)
        chunk += data
        span = self._span_ns
        if span is None:
            self._span_ns = (at_ns, at_ns)
        elif at_ns > span[1]:
            self._span_ns = (span[0], at_ns)
        elif at_ns < span[0]:
            self._span_ns = (at_ns, span[1])
        if len(chunk) > self._chunk_bytes:
            self._end_chunk()

    def finish(self) -> None:
        """Write the last chunk and the summary by which readers find everything."""
        self._end_chunk()
        self._write(_bytes_of(self._records.DataEnd(0)))
        start, summary, offsets = self._at, bytearray(), []
        for opcode, records in (
            (SCHEMA, self._schemas),
            (CHANNEL, self._channels),
            (STATISTICS, [self._statistics()]),
            (CHUNK_INDEX, self._chunks),
            (ATTACHMENT_INDEX, []),
            (METADATA_INDEX, self._metadata),
        ):
            group = b"".join(map(_bytes_of, records))
            offsets.append(self._records.SummaryOffset(opcode, start + len(summary), len(group)))
            summary += group
        offsets_start = start + len(summary)
        summary += b"".join(map(_bytes_of, offsets))
        begin = pack("<BQQQ", FOOTER, FOOTER_BYTES, start, offsets_start)
        crc = zlib.crc32(begin, zlib.crc32(summary))
        self._write(summary)
        self._write(
            _bytes_of(self._records.Footer(summary_start=start, summary_offset_start=offsets_start, summary_crc=crc))
        )
        self._write(MAGIC)

    def _statistics(self) -> Statistics:
        return self._records.Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_end_time=self._last_ns,
            message_start_time=self._first_ns,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )

    def _end_chunk(self) -> None:
        """Write the chunk with the index of each channel in it; nothing without a message."""
        if self._span_ns is None:
            return
        first_ns, last_ns = self._span_ns
        self._first_ns = min(self._first_ns, first_ns) if self._chunks else first_ns
        self._last_ns = max(self._last_ns, last_ns)
        start, size = self._at, len(self._chunk)
        content = bytes(self._chunk)
        record = _bytes_of(self._records.Chunk("", content, last_ns, first_ns, zlib.crc32(content), size))
        self._write(record)
        indexed, offsets = self._at, {}
        for channel, entries in self._entries.items():
            offsets[channel] = self._at
            if byteorder == "big":
                entries.byteswap()
            data = entries.tobytes()
            self._write(INDEX_HEAD.pack(MESSAGE_INDEX, INDEX_HEAD.size - 9 + len(data), channel, len(data)))
            self._write(data)
            self._counts[channel] += len(entries) // 2
        self._chunks.append(
            self._records.ChunkIndex(
                chunk_length=len(record),
                chunk_start_offset=start,
                compression="",
                compressed_size=size,
                message_end_time=last_ns,
                message_index_length=self._at - indexed,
                message_index_offsets=offsets,
                message_start_time=first_ns,
                uncompressed_size=size,
            )
        )
        self._chunk.clear()
        self._entries.clear()
        self._span_ns = None

    def _write(self, data: bytes | bytearray) -> None:
        self._file.write(data)
        self._at += len(data)


def _bytes_of(record: McapRecord) -> bytes:
    from mcap.data_stream import RecordBuilder

    builder = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()
    return data
