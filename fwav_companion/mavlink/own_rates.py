"""The rates at which the autopilot sends by itself the messages that we ask of it.

Before its first request a message is stopped, set to its default, and its interval read: a request of an earlier run
of this service would be taken for the autopilot's own rate otherwise. The stop is for messages without a default:
ArduPilot refuses to reset these (GCS_Common.cpp, set_message_interval), ATTITUDE_QUATERNION among them. ArduPilot's
default is the rate of the message's group, as SRn_* or a station's REQUEST_DATA_STREAM set it last.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf

from fwav_companion.mavlink.client.subscriptions import MESSAGE_IDS
from fwav_companion.mavlink.wire import enums
from fwav_companion.types.messages import Message
from fwav_companion.types.situation import AutopilotKind

MAX_TRIES = 2
"""Autopilots that do not answer are not asked more often."""
STOP_US, DEFAULT_US = -1.0, 0.0
"""param2 of SET_MESSAGE_INTERVAL (common.xml)."""
_NAMES = {number: name for name, number in MESSAGE_IDS.items()}


class OwnRates:
    """Asks once for each message, and keeps what MESSAGE_INTERVAL answers."""

    __slots__ = ("_asked", "_enabled", "_hz", "_kind")

    def __init__(self, *, enabled: bool):
        """``enabled``: false where no link needs to know."""
        self._enabled = enabled
        self._kind = AutopilotKind.OTHER
        self._asked: dict[str, int] = {}
        self._hz: dict[str, float] = {}

    def begin(self, kind: AutopilotKind) -> None:
        """Nothing is known of this autopilot."""
        self._kind = kind
        self._asked.clear()
        self._hz.clear()

    def hz(self, name: str) -> float:
        """Hertz; 0: it is not sent by itself, or that is not known yet; inf: whenever there is something new."""
        return self._hz.get(name, 0.0)

    def questions(self, name: str) -> Sequence[tuple[int, float, float]]:
        """(command, param1, param2) of what goes out before the message is asked for; empty where that is known."""
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
        """A station sets groups of ArduPilot's to other rates: these are its messages' defaults from now on.

        Higher ones count as the station's alone, so that they are forgotten with it.
        """
        for msgid, hz in rates.items():
            name = _NAMES.get(msgid, "")
            if name in self._hz:
                self._hz[name] = min(self._hz[name], hz or 0.0)

    def on_interval(self, message: Message) -> str:
        """The name of the message that a MESSAGE_INTERVAL tells of, if it answers one of ours, as the first one does;
        else "".
        """
        name = _NAMES.get(message.fields.message_id, "")
        if name not in self._asked or name in self._hz:
            return ""
        interval_us = message.fields.interval_us
        # PX4 streams of unlimited rate have the interval -1 (mavlink_receiver.cpp, get_message_interval; a stopped
        # stream has 0 there); common.xml and ArduPilot say -1 of a disabled one.
        unlimited = interval_us < 0 and self._kind is AutopilotKind.PX4
        self._hz[name] = 1e6 / interval_us if interval_us > 0 else inf if unlimited else 0.0
        return name
