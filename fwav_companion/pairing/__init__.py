"""Detections placed in time and on the vehicle. PURE: telemetry is handed in behind a small protocol."""

from fwav_companion.pairing.pairer import PairedFrame, Pairer, RefusedFrame
from fwav_companion.pairing.protocols import VehicleSource
from fwav_companion.pairing.timing import CameraTiming, StampRule
from fwav_companion.pairing.view import CameraView, sees_nothing
from fwav_companion.pairing.waiting import WaitingFrames

__all__ = [
    "CameraTiming",
    "CameraView",
    "PairedFrame",
    "Pairer",
    "RefusedFrame",
    "StampRule",
    "VehicleSource",
    "WaitingFrames",
    "sees_nothing",
]
