"""SHELL: the picture live for Foxglove and Lichtblick, by Foxglove's WebSocket. The extra ``foxglove``."""

from __future__ import annotations

import logging
import threading
from typing import TYPE_CHECKING

import msgspec

from fwav_companion.errors import UserError
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.picture_messages import PictureMessages
from fwav_companion.ground.viewer_gate import ViewerGate
from fwav_companion.recording.exports.viewer_schemas import TOPICS, schema_text

if TYPE_CHECKING:
    from foxglove import Channel

SENT = ("/tf", "/vehicle/location", "/targets/location", "/targets/scene", "/log")
WHOLE_S = 1.0
"""Interval of the whole picture: a viewer that has just connected knows nothing of earlier changes."""
STOP_S = 2.0
"""Longest wait for the library's server to stop, seconds: it waits for connections that have sent no request."""


class ViewerOutput:
    """A server for viewers behind a gate. The library sends in its own thread; a slow viewer misses messages."""

    def __init__(self, host: str, port: int, picture: GroundPicture) -> None:
        self._host, self._port, self._picture = host, port, picture
        self._messages = PictureMessages()
        self._channels: dict[str, Channel] = {}
        self._revision = 0
        self._whole_unix = 0.0
        self._gate: ViewerGate | None = None

    def start(self) -> None:
        """Listen. UserError where the address cannot be used."""
        import foxglove

        # It writes a line for each viewer that goes away: strangers would fill the log.
        logging.getLogger("foxglove").setLevel(logging.CRITICAL)
        self._context = context = foxglove.Context()  # channels close with it
        try:
            self._gate = ViewerGate(self._host, self._port)
            self._server = foxglove.start_server(name="fwav-companion", host="127.0.0.1", port=0, context=context)
            self._gate.start(self._server.port)
        except (OSError, RuntimeError) as error:
            if self._gate is not None:
                self._gate.close()
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
            if self._gate is not None:
                self._gate.close()
            stopping = threading.Thread(target=self._server.stop, name="stop of the viewers' server", daemon=True)
            stopping.start()
            stopping.join(STOP_S)
            for channel in self._channels.values():
                channel.close()
            self._channels.clear()
