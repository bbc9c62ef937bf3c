"""Autopilots by name, for ``--autopilot``: each given as its differences from the scenario's autopilot."""

from __future__ import annotations

from typing import Any

_ONE_WAY: dict[str, Any] = {"autopilot.sends_timesync": False, "autopilot.answers_timesync": False}
_SMALL: dict[str, Any] = {
    **_ONE_WAY,
    "autopilot.has_quaternion": False,
    "autopilot.sends_home": False,
    "autopilot.rangefinder": False,
    "autopilot.pitch_trim_deg": 0.0,
    "autopilot.true_ceiling_hz": 50.0,
}
AUTOPILOTS: dict[str, tuple[str, dict[str, Any]]] = {
    "inav": (
        "INAV: streams by itself, heeds REQUEST_DATA_STREAM in silence, answers nothing, no TIMESYNC",
        {**_SMALL, "autopilot.firmware": "inav", "autopilot.streams": "inav", "autopilot.answers": "groups_only"},
    ),
    "betaflight": (
        "Betaflight: system 0, component 200, MAVLink 1, streams by itself, reads nothing; no body rates",
        {
            **_SMALL,
            "autopilot.firmware": "betaflight",
            "autopilot.streams": "betaflight",
            "autopilot.answers": "nothing",
            "autopilot.system_id": 0,
            "autopilot.component_id": 200,
            "autopilot.mavlink_version": 1,
        },
    ),
    "mute": (
        "a one-way wire: the scenario's autopilot streams, and nothing reaches it",
        {**_ONE_WAY, "autopilot.answers": "nothing"},
    ),
    "ack-only": (
        "rate requests are obeyed and acknowledged, GET_MESSAGE_INTERVAL is never answered",
        {"autopilot.answers": "ack_only"},
    ),
}
