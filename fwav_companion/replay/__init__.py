"""PURE: replays a recording through the pipeline of the service: telemetry and detections in, target lines out.

``telemetry`` decodes a .tlog or an autopilot's log into messages; ``recorded`` joins them with the detections on one
clock; ``driver`` feeds both to the pipeline in order of time.
"""

from fwav_companion.replay.driver import replay
from fwav_companion.replay.recorded import Recording, join, read_recording
from fwav_companion.replay.telemetry import TelemetryRead, read_telemetry

__all__ = ["Recording", "TelemetryRead", "join", "read_recording", "read_telemetry", "replay"]
