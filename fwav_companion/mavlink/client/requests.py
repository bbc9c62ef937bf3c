"""Builds requests to the adopted autopilot, with its address filled in."""

from __future__ import annotations

from typing import Any

from fwav_companion.types.messages import Destination, Outgoing
from fwav_companion.types.situation import Autopilot


def request(autopilot: Autopilot, component: int, name: str, fields: dict[str, Any]) -> Outgoing:
    """Return a message with target fields, from our ``component``."""
    target = {"target_system": autopilot.system, "target_component": autopilot.component}
    return Outgoing(name=name, fields=target | fields, to=Destination.AUTOPILOT, component=component)


def command(
    autopilot: Autopilot, component: int, number: int, param1: float, param2: float = 0.0, *, confirmation: int = 0
) -> Outgoing:
    """Return a COMMAND_LONG; ``confirmation`` counts its repetitions."""
    fields = {"command": number, "confirmation": confirmation, "param1": float(param1), "param2": float(param2)}
    rest = dict.fromkeys(("param3", "param4", "param5", "param6", "param7"), 0.0)
    return request(autopilot, component, "COMMAND_LONG", fields | rest)
