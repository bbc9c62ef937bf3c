"""A ground station of the demonstration: receives MAVLink over UDP, decodes it, and sends its own heartbeat."""

from __future__ import annotations

import socket
import time
from collections import Counter, deque
from types import TracebackType
from typing import Any, Self

from fwav_companion.mavlink.wire.codec import Encoder, decode
from fwav_companion.mavlink.wire.scanner import Scanner
from fwav_companion.types import Message

COMPANION, CAMERA = 191, 100
SYSTEM, COMPONENT = 255, 190
"""System and component id that ground stations use."""
HEARTBEAT = {
    "type": 6,  # MAV_TYPE_GCS
    "autopilot": 8,  # MAV_AUTOPILOT_INVALID
    "base_mode": 0,
    "custom_mode": 0,
    "system_status": 4,
    "mavlink_version": 3,
}
RATES_OVER_S = 3.0
"""Time over which message rates are counted, seconds."""
TEXTS_KEPT = 200


class GroundStation:
    """A ground station on a free port of loopback."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.setblocking(False)
        self._scanner = Scanner(datagrams=True)
        self._encoder = Encoder(SYSTEM, COMPONENT)
        self._beat_s = 0.0
        self._recent: deque[tuple[float, str]] = deque(maxlen=5000)
        self.heard: Counter[str] = Counter()
        """Number of messages from the companion and its camera component, by name."""
        self.place: dict[str, float] | None = None
        """The selected target in the newest CAMERA_TRACKING_GEO_STATUS: lat, lon, alt_amsl, h_acc."""
        self.texts: deque[str] = deque(maxlen=TEXTS_KEPT)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._socket.close()

    @property
    def port(self) -> int:
        """The port to which the companion sends."""
        port: int = self._socket.getsockname()[1]
        return port

    def listen(self) -> None:
        """Take every datagram that has arrived."""
        while True:
            try:
                data, sender = self._socket.recvfrom(65536)
            except BlockingIOError:
                return
            except OSError:  # the companion has ended: our last heartbeat was refused
                continue
            self._beat(sender)
            for frame in self._scanner.feed(data):
                if frame.definition is not None:
                    self._take(decode(frame))

    def rates_hz(self) -> dict[str, float]:
        """Rates of the companion's messages over the last seconds, by name."""
        since_s = time.monotonic() - RATES_OVER_S
        counts = Counter(name for at_s, name in self._recent if at_s >= since_s)
        return {name: count / RATES_OVER_S for name, count in counts.items()}

    def _take(self, message: Message) -> None:
        if message.component not in (COMPANION, CAMERA):
            return
        self.heard[message.name] += 1
        self._recent.append((time.monotonic(), message.name))
        fields: Any = message.fields
        if message.name == "CAMERA_TRACKING_GEO_STATUS":
            self.place = {
                "lat": fields.lat / 1e7,
                "lon": fields.lon / 1e7,
                "alt_amsl": fields.alt,
                "h_acc": fields.h_acc,
            }
        elif message.name == "STATUSTEXT":
            self.texts.append(fields.text)

    def _beat(self, to: tuple[str, int]) -> None:
        """Send the heartbeat once a second."""
        now_s = time.monotonic()
        if now_s - self._beat_s >= 1.0:
            self._beat_s = now_s
            self._socket.sendto(self._encoder.encode("HEARTBEAT", HEARTBEAT), to)
