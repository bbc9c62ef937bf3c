"""MAVLink codec by pymavlink, so that the mock shares no code with the companion's. The only module that imports it."""

from __future__ import annotations

from typing import Any, NamedTuple

from pymavlink.dialects.v10 import ardupilotmega as first_dialect
from pymavlink.dialects.v20 import ardupilotmega as dialect

MESSAGES: dict[str, Any] = {cls.msgname: cls for cls in dialect.mavlink_map.values()}
FIRST_MESSAGES: dict[str, Any] = {cls.msgname: cls for cls in first_dialect.mavlink_map.values()}
"""Messages of MAVLink 1, without extension fields."""
NAMES: dict[int, str] = {number: cls.msgname for number, cls in dialect.mavlink_map.items()}
NUMBERS: dict[str, int] = {name: number for number, name in NAMES.items()}


class Heard(NamedTuple):
    """A received message."""

    name: str
    fields: dict[str, Any]
    system: int
    component: int


class Speaker:
    """Encoder of one component, with its own sequence counter."""

    def __init__(self, system: int, component: int, version: int = 2) -> None:
        self.system, self.component = system, component
        self._messages = FIRST_MESSAGES if version == 1 else MESSAGES
        codec = first_dialect if version == 1 else dialect
        self._mav = codec.MAVLink(None, srcSystem=system, srcComponent=component)

    def frame(self, name: str, fields: dict[str, Any]) -> bytes:
        """Encodes a message."""
        message = self._messages[name]
        known = {key: value for key, value in fields.items() if key in message.fieldnames}
        packed: bytes = bytes(message(**known).pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        return packed


class Listener:
    """Decodes a stream of bytes; damaged frames are dropped."""

    def __init__(self) -> None:
        self._mav = dialect.MAVLink(None)
        self._mav.robust_parsing = True
        self.damaged = 0

    def feed(self, data: bytes) -> list[Heard]:
        """Returns the messages that these bytes complete."""
        heard = []
        for message in self._mav.parse_buffer(data) or ():
            if message.get_type() == "BAD_DATA" or message.get_type().startswith("UNKNOWN"):
                self.damaged += 1
                continue
            fields = {name: getattr(message, name) for name in message.get_fieldnames()}
            heard.append(Heard(message.get_type(), fields, message.get_srcSystem(), message.get_srcComponent()))
        return heard
