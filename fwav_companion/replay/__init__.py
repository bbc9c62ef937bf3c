"""PURE: replays a recording through the pipeline of the service: telemetry and detections in, target lines out.

``telemetry`` decodes a .tlog or an autopilot's log into messages; ``recorded`` joins them with the detections on one
clock; ``driver`` feeds both to the pipeline in order of time. ``photographs`` replays pictures with poses of their own.
"""

from fwav_companion.replay.driver import replay
from fwav_companion.replay.photographs import (
    Photographs,
    join_photographs,
    replay_photographs,
    require_photograph_config,
)
from fwav_companion.replay.recorded import Recording, join, read_recording
from fwav_companion.replay.telemetry import TelemetryRead, read_telemetry

__all__ = [
    "Photographs",
    "Recording",
    "TelemetryRead",
    "join",
    "join_photographs",
    "read_recording",
    "read_telemetry",
    "replay",
    "replay_photographs",
    "require_photograph_config",
]
