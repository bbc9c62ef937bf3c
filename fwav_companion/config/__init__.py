"""The configuration file: one frozen value, each key with its default, unit and meaning beside it.

:func:`parse` is pure, :func:`load` opens the file. Files and their keys have the user's units (degrees); what rooms
need in radians is a property here.
"""

from fwav_companion.config.document import Config
from fwav_companion.config.estimation import READOUT_SIGMA_UNKNOWN_S, GroundConfig, TrackingConfig, UncertaintyConfig
from fwav_companion.config.files import load, load_signing_key
from fwav_companion.config.inputs import (
    CameraConfig,
    DetectionsConfig,
    LinkConfig,
    MountConfig,
    RatesConfig,
    SigningConfig,
    StampRule,
    VehicleConfig,
    VisionConfig,
)
from fwav_companion.config.outputs import PublishConfig, RecordConfig, StateConfig, StatusConfig
from fwav_companion.config.reading import parse

__all__ = [
    "READOUT_SIGMA_UNKNOWN_S",
    "CameraConfig",
    "Config",
    "DetectionsConfig",
    "GroundConfig",
    "LinkConfig",
    "MountConfig",
    "PublishConfig",
    "RatesConfig",
    "RecordConfig",
    "SigningConfig",
    "StampRule",
    "StateConfig",
    "StatusConfig",
    "TrackingConfig",
    "UncertaintyConfig",
    "VehicleConfig",
    "VisionConfig",
    "load",
    "load_signing_key",
    "parse",
]
