"""The autopilot's way out: its own frames and those of others behind its link, on a wire with faults."""

from __future__ import annotations

from random import Random
from typing import Any

from sitl_mock.codec import Speaker
from sitl_mock.options import Options
from sitl_mock.wire import Wire


class Radio:
    """``taken()``: each piece of bytes with the instant at which it arrives at the companion."""

    def __init__(self, options: Options, start_host_ns: int) -> None:
        self._wire = Wire(options.downlink, start_host_ns, Random(f"{options.seed}/downlink"))
        self._speaker = Speaker(options.autopilot.system_id, options.autopilot.component_id)
        self._down_until = start_host_ns
        self._out: list[tuple[int, bytes]] = []

    def say(self, name: str, fields: dict[str, Any], at_ns: int) -> None:
        """Sends a message of the autopilot, unless it is down."""
        if not self.is_down(at_ns):
            self.put(self._speaker.frame(name, fields), at_ns)

    def tell(self, severity: int, text: str, at_ns: int) -> None:
        """STATUSTEXT."""
        self.say("STATUSTEXT", {"severity": severity, "text": text.encode()[:50]}, at_ns)

    def put(self, frame: bytes, at_ns: int) -> None:
        """Hands a frame, whoever made it, to the wire."""
        self._out.extend(self._wire.carry(frame, at_ns))

    def down_until(self, back_ns: int) -> None:
        """The autopilot neither speaks nor hears before that."""
        self._down_until = back_ns

    def is_down(self, at_ns: int) -> bool:
        """Whether it is down at this instant."""
        return at_ns < self._down_until

    def taken(self) -> list[tuple[int, bytes]]:
        """What was sent since this was asked last."""
        out, self._out = self._out, []
        return out
