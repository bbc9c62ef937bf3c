"""The sigmas that a configuration file writes down; its defaults are those of a vehicle and do not count. PURE."""

from __future__ import annotations

import tomllib

from fwav_companion.tools.locate.world import Configured

UNSTATED_DELAY_S = 0.01
"""What `init` writes for the delay of a camera's own stamps; it says nothing about a video's telemetry."""


def stated_uncertainty(text: str) -> Configured:
    """The numbers of [uncertainty] in a configuration that was found valid; "auto" is by the pictures' source."""
    table = tomllib.loads(text).get("uncertainty", {})
    if table.get("time_offset_sigma_s") == UNSTATED_DELAY_S:
        del table["time_offset_sigma_s"]
    known = {name: table[name] for name in Configured.__struct_fields__ if isinstance(table.get(name), int | float)}
    return Configured(**known)
