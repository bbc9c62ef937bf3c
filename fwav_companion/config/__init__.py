"""The configuration file: one frozen value, each key with its default, unit and meaning beside it.

:func:`parse` is pure, :func:`load` opens the file. Files and their keys have the user's units (degrees); what rooms
need in radians is a property here.
"""

from fwav_companion.config.document import Config
from fwav_companion.config.estimation import READOUT_SIGMA_UNKNOWN_S, Ground, Tracking, Uncertainty
from fwav_companion.config.files import load, load_signing_key
from fwav_companion.config.inputs import (
    Camera,
    Detections,
    LinkConfig,
    Mount,
    Rates,
    Signing,
    StampRule,
    Vehicle,
    Vision,
)
from fwav_companion.config.outputs import Publish, Record, State, Status
from fwav_companion.config.reading import parse

__all__ = [
    "READOUT_SIGMA_UNKNOWN_S",
    "Camera",
    "Config",
    "Detections",
    "Ground",
    "LinkConfig",
    "Mount",
    "Publish",
    "Rates",
    "Record",
    "Signing",
    "StampRule",
    "State",
    "Status",
    "Tracking",
    "Uncertainty",
    "Vehicle",
    "Vision",
    "load",
    "load_signing_key",
    "parse",
]
