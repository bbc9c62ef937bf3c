"""Requests rare messages and a few parameters from the autopilot once, after it is adopted or rebooted."""

from __future__ import annotations

from math import isfinite

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.client.requests import command, request
from fwav_companion.mavlink.client.subscriptions import MESSAGE_IDS
from fwav_companion.mavlink.wire import enums
from fwav_companion.types.messages import Message, Outgoing
from fwav_companion.types.situation import Autopilot, AutopilotKind

SELDOM = ("HOME_POSITION", "GPS_GLOBAL_ORIGIN")
"""Messages that are sent once, possibly before we listened."""
SELDOM_PAUSE_NS = 10 * NS_PER_S
"""Pause between requests: these messages do not exist before the first position, so a refusal is not final."""
LANDING_PARAMETERS = (
    *("PLND_LAG", "PLND_ENABLED", "PLND_TYPE", "PLND_YAW_ALIGN", "PLND_ORIENT"),
    *("PLND_CAM_POS_X", "PLND_CAM_POS_Y", "PLND_CAM_POS_Z", "PLND_LAND_OFS_X", "PLND_LAND_OFS_Y"),
)
"""Parameters of ArduPilot's AC_PrecLand: whether it uses LANDING_TARGET, with which delay, and which offsets it adds.
Read by ``check``."""
PARAMETERS = ("SCHED_LOOP_RATE", "PTCH_TRIM_DEG", "TRIM_PITCH_CD", "FLIGHT_OPTIONS", *LANDING_PARAMETERS)
"""Parameters of ArduPilot: the age of its attitudes, the rotation of its ATTITUDE, and precision landing. Fourteen
requests at once, FOLLOWED and the five of LANDING_LIMITS just fit its queue of 20 (GCS_Param.cpp)."""
FOLLOWED = "FOLL_SYSID"
"""System that ArduPilot follows: asked for where this service sends FOLLOW_TARGET."""
LANDING_LIMITS = ("PLND_STRICT", "PLND_RET_MAX", "PLND_XY_DIST_MAX", "PLND_ALT_MIN", "PLND_ALT_MAX")
"""What AC_PrecLand does without a target: asked for where [publish] landing_label names one, and read by ``check``."""
PARAMETER_PAUSE_NS = NS_PER_S
PARAMETER_ROUNDS = 3
"""Rounds of requests: a copter has no PTCH_TRIM_DEG, and does not answer a request for it."""


class OneShotRequests:
    """Sends REQUEST_MESSAGE until each message is heard, and PARAM_REQUEST_READ at most three times."""

    def __init__(self, component: int, *, more_parameters: tuple[str, ...] = ()):
        """``more_parameters``: names in addition to PARAMETERS."""
        self._component = component
        self._names = (*PARAMETERS, *more_parameters)
        self._autopilot: Autopilot | None = None
        self._seldom_ns: dict[str, HostNs] = {}
        self._round_ns: HostNs | None = None
        self._rounds = 0
        self.parameters: dict[str, float] = {}
        """Values of parameters that the autopilot has reported since it started."""

    @property
    def wake_at(self) -> HostNs | None:
        """Time of the next request; None if there is none."""
        due = list(self._seldom_ns.values())
        if self._round_ns is not None:
            due.append(self._round_ns)
        return min(due, default=None)

    def begin(self, autopilot: Autopilot, now: HostNs) -> None:
        """Start over with an autopilot of which no values are known."""
        self._autopilot = autopilot
        self._seldom_ns = dict.fromkeys(SELDOM, now)
        self._round_ns = now if autopilot.kind is AutopilotKind.ARDUPILOT else None
        self._rounds = 0
        self.parameters.clear()

    def on_message(self, message: Message) -> None:
        """Take a message of the autopilot: a parameter's value, or one of the requested messages."""
        if message.name == "PARAM_VALUE":
            name, value = message.fields.param_id, message.fields.param_value
            if name in self._names and isfinite(value):
                self.parameters[name] = value
        else:
            self._seldom_ns.pop(message.name, None)

    def on_wake(self, now: HostNs, *, parameters: bool = True) -> list[Outgoing]:
        """Return the requests that are due. ``parameters``: whether those for parameters may leave now."""
        if self._autopilot is None:
            return []
        asked = self._ask_seldom(self._autopilot, now)
        return [*asked, *self._ask_parameters(self._autopilot, now)] if parameters else asked

    def _ask_seldom(self, autopilot: Autopilot, now: HostNs) -> list[Outgoing]:
        due = [name for name, when in self._seldom_ns.items() if when <= now]
        self._seldom_ns |= dict.fromkeys(due, HostNs(now + SELDOM_PAUSE_NS))
        return [command(autopilot, self._component, enums.MAV_CMD_REQUEST_MESSAGE, MESSAGE_IDS[name]) for name in due]

    def _ask_parameters(self, autopilot: Autopilot, now: HostNs) -> list[Outgoing]:
        if self._round_ns is None or now < self._round_ns:
            return []
        missing = [name for name in self._names if name not in self.parameters]
        self._rounds += 1
        over = not missing or self._rounds >= PARAMETER_ROUNDS
        self._round_ns = None if over else HostNs(now + PARAMETER_PAUSE_NS)
        return [
            request(autopilot, self._component, "PARAM_REQUEST_READ", {"param_id": name, "param_index": -1})
            for name in missing
        ]
