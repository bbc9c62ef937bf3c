"""SHELL: a recording as an MCAP file with JSON messages, for Foxglove and Lichtblick. The extra ``mcap``.

Uncompressed, so that the pure Python library is enough on every board, and the same recording gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import BinaryIO, Final

import msgspec

from fwav_companion.recording.exports.viewer_scene import Message
from fwav_companion.recording.exports.viewer_schemas import TOPICS, schema_text

CHUNK_BYTES: Final = 1_048_576
HEIGHTS: Final = {"altitude": "metres above mean sea level", "map": "ENU about the origin, metres"}


def write_mcap(file: BinaryIO, messages: Iterable[Message]) -> int:
    """Write the messages in order, as they come; returns their number. Memory is that of one chunk and its indices."""
    from fwav_companion.recording.exports.mcap_chunks import ChunkedFile

    writer = ChunkedFile(file, CHUNK_BYTES, "fwav-companion")
    schemas = {name: writer.add_schema(name, "jsonschema", schema_text(name)) for name in sorted({*TOPICS.values()})}
    channels = {topic: writer.add_channel(topic, "json", schemas[name]) for topic, name in TOPICS.items()}
    writer.add_metadata("fwav-companion", HEIGHTS)
    encode, add, count = msgspec.json.Encoder().encode, writer.add_message, 0
    for count, (topic, at_ns, content) in enumerate(messages, 1):
        add(channels[topic], at_ns, encode(content), count & 0xFFFFFFFF)
    writer.finish()
    return count
