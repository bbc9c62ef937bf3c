"""SHELL: the picture live for Foxglove and Lichtblick, by Foxglove's WebSocket. The extra ``foxglove``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from fwav_companion.errors import UserError
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.picture_messages import PictureMessages
from fwav_companion.recording.exports.viewer_schemas import TOPICS, schema_text

if TYPE_CHECKING:
    from foxglove import Channel

SENT = ("/tf", "/vehicle/location", "/targets/location", "/targets/scene", "/log")
WHOLE_S = 1.0
"""Interval of the whole picture: a viewer that has just connected knows nothing of earlier changes."""


class ViewerOutput:
    """A server for any number of viewers. The library sends in its own thread; a slow viewer misses messages."""

    def __init__(self, host: str, port: int, picture: GroundPicture) -> None:
        self._host, self._port, self._picture = host, port, picture
        self._messages = PictureMessages()
        self._channels: dict[str, Channel] = {}
        self._revision = 0
        self._whole_unix = 0.0

    def start(self) -> None:
        """Listen. UserError where the address cannot be used."""
        import foxglove

        self._context = context = foxglove.Context()  # channels close with it
        try:
            self._server = foxglove.start_server(
                name="fwav-companion", host=self._host, port=self._port, context=context
            )
        except (OSError, RuntimeError) as error:
            raise UserError(f"--foxglove {self._host}:{self._port}: {str(error).partition(chr(10))[0]}") from None
        for topic in SENT:
            name = TOPICS[topic]
            schema = foxglove.Schema(name=name, encoding="jsonschema", data=schema_text(name))
            self._channels[topic] = foxglove.Channel(topic, schema=schema, message_encoding="json", context=context)
        self._picture.on_source(f"foxglove {self._host}:{self._port}", works=True, text="viewers can connect")

    def tick(self, now: float) -> None:
        """Send what has changed; once a second, everything."""
        whole = now >= self._whole_unix + WHOLE_S
        if whole:
            self._whole_unix = now
        elif self._revision == self._picture.revision:
            return
        update = self._picture.update_since(0 if whole else self._revision, now)
        self._revision = update.revision
        for topic, at_ns, content in self._messages.of_update(update):
            self._channels[topic].log(msgspec.json.encode(content), log_time=at_ns)

    def close(self) -> None:
        """Stop the server."""
        if self._channels:
            self._server.stop()
            for channel in self._channels.values():
                channel.close()
            self._channels.clear()
