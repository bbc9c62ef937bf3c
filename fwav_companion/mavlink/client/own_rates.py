"""Finds the rates at which the autopilot sends, by itself, the messages that this service requests.

Before the first request for a message, this module stops the message, sets it to its default, and reads its interval.
Otherwise a request of an earlier run of this service would be mistaken for the autopilot's own rate. The stop is for
messages without a default: ArduPilot refuses to reset these (GCS_Common.cpp, set_message_interval),
ATTITUDE_QUATERNION among them. ArduPilot's default is the rate of the message's group, as last set by SRn_* or by a
station's REQUEST_DATA_STREAM.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf

from fwav_companion.mavlink.client.subscriptions import MESSAGE_IDS
from fwav_companion.mavlink.wire import enums
from fwav_companion.types.messages import Message
from fwav_companion.types.situation import AutopilotKind

MAX_TRIES = 2
"""Tries per message: an autopilot that does not answer is not asked again."""
STOP_US, DEFAULT_US = -1.0, 0.0
"""param2 of SET_MESSAGE_INTERVAL (common.xml)."""
_NAMES = {number: name for name, number in MESSAGE_IDS.items()}


class OwnRates:
    """Requests the own rate of each message once, and keeps the MESSAGE_INTERVAL answers."""

    __slots__ = ("_asked", "_enabled", "_hz", "_kind")

    def __init__(self, *, enabled: bool):
        """Start without rates. ``enabled``: False if no link needs them."""
        self._enabled = enabled
        self._kind = AutopilotKind.OTHER
        self._asked: dict[str, int] = {}
        self._hz: dict[str, float] = {}

    def begin(self, kind: AutopilotKind) -> None:
        """Start over with an autopilot whose rates are unknown."""
        self._kind = kind
        self._asked.clear()
        self._hz.clear()

    def hz(self, name: str) -> float:
        """Return the own rate, hertz; 0: not sent by itself, or not known yet; inf: sent with every new value."""
        return self._hz.get(name, 0.0)

    def questions(self, name: str) -> Sequence[tuple[int, float, float]]:
        """Return (command, param1, param2) of the commands to send before the message is requested; empty if the rate
        is known.
        """
        tries = self._asked.get(name, 0)
        if not self._enabled or name in self._hz or tries >= MAX_TRIES:
            return ()
        self._asked[name] = tries + 1
        number = float(MESSAGE_IDS[name])
        return (
            (enums.MAV_CMD_SET_MESSAGE_INTERVAL, number, STOP_US),
            (enums.MAV_CMD_SET_MESSAGE_INTERVAL, number, DEFAULT_US),
            (enums.MAV_CMD_GET_MESSAGE_INTERVAL, number, 0.0),
        )

    def on_group(self, rates: Mapping[int, float | None]) -> None:
        """Process a station's request by group: its rates are the new defaults of the group's messages in ArduPilot.

        A higher rate counts as the station's alone, so that it is forgotten with the station.
        """
        for msgid, hz in rates.items():
            name = _NAMES.get(msgid, "")
            if name in self._hz:
                self._hz[name] = min(self._hz[name], hz or 0.0)

    def on_interval(self, message: Message) -> str:
        """Return the name of the message that a MESSAGE_INTERVAL reports on if it is the first answer to a request of
        ours, else "".
        """
        name = _NAMES.get(message.fields.message_id, "")
        if name not in self._asked or name in self._hz:
            return ""
        interval_us = message.fields.interval_us
        # PX4 streams of unlimited rate have the interval -1 (mavlink_receiver.cpp, get_message_interval; a stopped
        # stream has 0 there); in common.xml and ArduPilot, -1 means disabled.
        unlimited = interval_us < 0 and self._kind is AutopilotKind.PX4
        self._hz[name] = 1e6 / interval_us if interval_us > 0 else inf if unlimited else 0.0
        return name
