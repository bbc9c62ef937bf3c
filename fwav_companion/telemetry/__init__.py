"""Decodes telemetry to samples, estimates the autopilot's clock, and gives the vehicle's state at any recent instant.
Pure: the time is an argument.

``telemetry`` is the interface; ``intake`` stores each message through ``decoding``; ``vehicle_history`` interpolates;
``world`` holds the origin and the home surface; ``clock`` and ``attitude`` are rooms of their own; ``gimbal`` is what
may carry the camera.
"""

from fwav_companion.telemetry.clock.clock import Clock
from fwav_companion.telemetry.clock.clock_news import ClockRate, ClockSlipped
from fwav_companion.telemetry.events import (
    AttitudeSource,
    ClockContradicted,
    GimbalHeadingDiffers,
    GimbalUnused,
    HomeMoved,
    LocalWorld,
    OriginSet,
    PitchTrimUndone,
    PositionJumped,
    PositionSource,
    Rebooted,
    RelativeWorld,
    StampDelay,
    TakeOffFound,
    TelemetryEvent,
)
from fwav_companion.telemetry.gimbal_reading import GIMBAL_MESSAGES
from fwav_companion.telemetry.rate_meter import RateMeter
from fwav_companion.telemetry.telemetry import Telemetry, TelemetryOptions
from fwav_companion.telemetry.world import World

__all__ = [
    "GIMBAL_MESSAGES",
    "AttitudeSource",
    "Clock",
    "ClockContradicted",
    "ClockRate",
    "ClockSlipped",
    "GimbalHeadingDiffers",
    "GimbalUnused",
    "HomeMoved",
    "LocalWorld",
    "OriginSet",
    "PitchTrimUndone",
    "PositionJumped",
    "PositionSource",
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
