"""The message rates that we ask of the autopilot: asked for, measured, and asked for again."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.nouns.messages import Message, Notice, Outgoing
from fwav_companion.nouns.situation import Autopilot


def default_wanted(attitude_hz: float, position_hz: float) -> dict[str, float]:
    """Message name -> Hz, by [rates]."""
    return {"ATTITUDE_QUATERNION": attitude_hz, "ATTITUDE": attitude_hz, "GLOBAL_POSITION_INT": position_hz}


class Rates:
    """Feed it every message of the adopted autopilot, and its own wakes."""

    def __init__(self, wanted: Mapping[str, float], *, attitude_message: str = "auto", component: int = 191):
        self._wanted = dict(wanted)
        self._attitude_message = attitude_message
        self._component = component

    @property
    def wake_at(self) -> HostNs | None:
        """When :meth:`on_wake` is due next; None while no autopilot is adopted."""
        return None

    def adopt(self, autopilot: Autopilot, now: HostNs) -> None:
        """Ask this autopilot from now on."""

    def ask_again(self, why: str, now: HostNs) -> None:
        """Everything that was asked for is forgotten over there: a reboot, or a link that was gone."""

    def on_message(self, message: Message, now: HostNs) -> None:
        """Count arrivals, and take acknowledgements and parameters."""

    def on_rate_request_passed(self, who: str, now: HostNs) -> None:
        """Somebody's REQUEST_DATA_STREAM or SET_MESSAGE_INTERVAL was forwarded on our link to the autopilot."""

    def on_wake(self, now: HostNs) -> list[Outgoing]:
        """What is to be asked now."""
        return []

    def notices(self) -> list[Notice]:
        """What is worth a line, since the last call."""
        return []

    def status(self) -> dict[str, Any]:
        """By message: asked, measured, state, undone_by."""
        return {}
