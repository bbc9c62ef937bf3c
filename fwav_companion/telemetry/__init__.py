"""Decoding to samples, the clock, and a history that can be asked for any instant. PURE: time is handed in."""

from fwav_companion.telemetry.clock.clock import Clock
from fwav_companion.telemetry.events import (
    AttitudeSource,
    HomeMoved,
    OriginSet,
    PitchTrimUndone,
    Rebooted,
    RelativeWorld,
    StampDelay,
    TakeOffFound,
    TelemetryEvent,
)
from fwav_companion.telemetry.rate_meter import RateMeter
from fwav_companion.telemetry.telemetry import Telemetry, TelemetryOptions
from fwav_companion.telemetry.world import World

__all__ = [
    "AttitudeSource",
    "Clock",
    "HomeMoved",
    "OriginSet",
    "PitchTrimUndone",
    "RateMeter",
    "Rebooted",
    "RelativeWorld",
    "StampDelay",
    "TakeOffFound",
    "Telemetry",
    "TelemetryEvent",
    "TelemetryOptions",
    "World",
]
