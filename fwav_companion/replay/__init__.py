"""A recording through the same pipeline that flew. Pure: telemetry and detections in, lines of a targets file out.

Reading order: ``telemetry``, ``recorded``, ``driver``.
"""

from fwav_companion.replay.driver import replay
from fwav_companion.replay.recorded import Recording, join, read_recording
from fwav_companion.replay.telemetry import TelemetryRead, read_telemetry

__all__ = ["Recording", "TelemetryRead", "join", "read_recording", "read_telemetry", "replay"]
