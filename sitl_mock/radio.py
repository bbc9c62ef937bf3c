"""The autopilot's downlink: its own frames and those of the components behind its link, on a wire with faults."""

from __future__ import annotations

from random import Random
from typing import Any

from sitl_mock.codec import Speaker
from sitl_mock.options import Options
from sitl_mock.wire import Wire


class Radio:
    """Downlink; ``taken()`` returns each piece of bytes with its instant of arrival at the companion."""

    def __init__(self, options: Options, start_host_ns: int) -> None:
        self._wire = Wire(options.downlink, start_host_ns, Random(f"{options.seed}/downlink"))
        self._speaker = Speaker(
            options.autopilot.system_id, options.autopilot.component_id, options.autopilot.mavlink_version
        )
        self._down_until = start_host_ns
        self._out: list[tuple[int, bytes]] = []

    def say(self, name: str, fields: dict[str, Any], at_ns: int) -> None:
        """Sends a message of the autopilot, unless the autopilot is down."""
        if not self.is_down(at_ns):
            self.put(self._speaker.frame(name, fields), at_ns)

    def statustext(self, severity: int, text: str, at_ns: int) -> None:
        """Sends a STATUSTEXT."""
        self.say("STATUSTEXT", {"severity": severity, "text": text.encode()[:50]}, at_ns)

    def put(self, frame: bytes, at_ns: int) -> None:
        """Puts an encoded frame of any component on the wire."""
        self._out.extend(self._wire.carry(frame, at_ns))

    def down_until(self, back_ns: int) -> None:
        """Sets the instant until which the autopilot neither sends nor receives."""
        self._down_until = back_ns

    def is_down(self, at_ns: int) -> bool:
        """Whether the autopilot is down at this instant."""
        return at_ns < self._down_until

    def taken(self) -> list[tuple[int, bytes]]:
        """Returns what was sent since the last call."""
        out, self._out = self._out, []
        return out
