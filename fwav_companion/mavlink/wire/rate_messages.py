"""Reads a station's request for message rates from its frame, and represents this service's own requests."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any, Final

import msgspec

from fwav_companion.mavlink.wire import enums
from fwav_companion.mavlink.wire.definitions import BY_NAME
from fwav_companion.mavlink.wire.frames import RawFrame
from fwav_companion.mavlink.wire.stream_groups import group_ids

REQUEST_DATA_STREAM: Final = BY_NAME["REQUEST_DATA_STREAM"].msgid
MESSAGE_INTERVAL: Final = BY_NAME["MESSAGE_INTERVAL"].msgid
COMMANDS: Final = frozenset(BY_NAME[name].msgid for name in ("COMMAND_LONG", "COMMAND_INT"))
RATE_REQUESTS: Final = COMMANDS | {REQUEST_DATA_STREAM, MESSAGE_INTERVAL}
"""Ids of the messages that may request a rate."""
HIGHEST_HZ: Final = 1000.0
"""Highest rate: ArduPilot treats intervals below a millisecond as one (GCS_Common.cpp, set_message_interval)."""
HIGHEST_ID: Final = 0xFFFFFF
START: Final = 1
"""REQUEST_DATA_STREAM.start_stop; 0 stops."""
HORIZON_ATTITUDE_HZ: Final = 4.0
"""Rate of an attitude that is only shown: enough for a horizon on a display."""


class RateRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Request for message rates in one frame, addressed to one component or to all."""

    system: int
    """System id of the sender."""
    component: int
    """Component id of the sender."""
    link: str
    """Name of the link on which it arrived."""
    source: str = ""
    """Host from which it arrived; "" where the link has only one peer."""
    target_system: int
    """0: every system."""
    target_component: int
    """0: every component."""
    rates: Mapping[int, float | None] = {}
    """Rate by message id, hertz. 0: stop. None: the receiver's own default."""
    by_group: bool = False
    """Whether it is a REQUEST_DATA_STREAM, which names a group of ArduPilot's messages."""
    command: int | None = None
    """Number of the command that carries it; None for a message, which is not acknowledged."""
    once: int | None = None
    """Id of a message that is requested a single time (REQUEST_MESSAGE)."""

    @property
    def requester(self) -> str:
        """Sender and link in the form of the log: ``255/190 on ground``."""
        return f"{self.system}/{self.component} on {self.link}"

    @property
    def sender(self) -> int:
        """Sender as ``system << 8 | component``."""
        return self.system << 8 | self.component

    def reaches(self, system: int, component: int) -> bool:
        """Return whether the request is addressed to this component, or to all."""
        return self.target_system in {0, system} and self.target_component in {0, component}


class OwnStreams(msgspec.Struct, frozen=True):
    """Messages of the adopted autopilot whose present rate this service requested."""

    system: int
    component: int
    before_hz: Mapping[int, float]
    """Rate by message id before our request, hertz; 0: the message did not come; inf: with every new value. A message
    that is not here comes at the autopilot's own rate."""
    stated: frozenset[int] = frozenset()
    """Ids of the messages whose rate before our request the autopilot states; the others were measured."""


def rate_request(frame: RawFrame, link: str, source: str) -> RateRequest | None:
    """Return the request that a frame carries; None for any other frame, and for a request without a definite rate."""
    if frame.definition is None or frame.msgid not in RATE_REQUESTS:
        return None
    fields = frame.definition.unpack(frame.data)
    asked = _asked(frame.msgid, fields)
    if asked is None:
        return None
    return RateRequest(
        system=frame.system,
        component=frame.component,
        link=link,
        source=source,
        target_system=frame.target_system,
        target_component=frame.target_component,
        **asked,
    )


def _asked(msgid: int, fields: Any) -> dict[str, Any] | None:
    if msgid == REQUEST_DATA_STREAM:
        if fields.start_stop > START:
            return None  # as ArduPilot does
        hz = min(float(fields.req_message_rate), HIGHEST_HZ) if fields.start_stop else 0.0
        return {"rates": dict.fromkeys(group_ids(fields.req_stream_id), hz), "by_group": True}
    if msgid == MESSAGE_INTERVAL:
        return {"rates": {fields.message_id: _hz(fields.interval_us)}}
    if not (isfinite(fields.param1) and 0 <= fields.param1 <= HIGHEST_ID):
        return None
    if fields.command == enums.MAV_CMD_SET_MESSAGE_INTERVAL:
        return {"rates": {int(fields.param1): _hz(fields.param2)}, "command": fields.command}
    if fields.command == enums.MAV_CMD_REQUEST_MESSAGE:
        return {"once": int(fields.param1)}
    return None


def _hz(interval_us: float) -> float | None:
    """Return the rate of a SET_MESSAGE_INTERVAL (common.xml): -1 disables (0 Hz), 0 requests the default rate
    (None). So do infinity and NaN: ArduPilot converts the latter to 0 on ARM, PX4 compares it (mavlink_receiver.cpp).
    """
    if interval_us == 0 or not isfinite(interval_us):
        return None
    return 0.0 if interval_us < 0 else min(1e6 / interval_us, HIGHEST_HZ)
