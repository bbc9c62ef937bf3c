"""Detections to sightings: the capture time of each detection's row, and the vehicle's state at that time. Pure.

:class:`WaitingFrames` holds a frame until attitudes after its capture have arrived. :class:`Pairer` then converts it to
a :class:`PairedFrame` or refuses it. Telemetry is passed in behind the protocol :class:`VehicleSource`.
"""

from fwav_companion.pairing.paired_frame import CameraView, PairedFrame, RefusedFrame, sees_nothing
from fwav_companion.pairing.pairer import Pairer
from fwav_companion.pairing.placement import LATEST_NS, PictureRows, Scaling, scaling_from_size
from fwav_companion.pairing.protocols import TwoClocks, VehicleSource
from fwav_companion.pairing.timing import CameraTiming, StampRule
from fwav_companion.pairing.waiting import WaitingFrames

__all__ = [
    "LATEST_NS",
    "CameraTiming",
    "CameraView",
    "PairedFrame",
    "Pairer",
    "PictureRows",
    "RefusedFrame",
    "Scaling",
    "StampRule",
    "TwoClocks",
    "VehicleSource",
    "WaitingFrames",
    "scaling_from_size",
    "sees_nothing",
]
