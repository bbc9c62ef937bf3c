"""The configuration file: one frozen value, each key with its default, unit and meaning next to it.

:func:`parse` is pure, :func:`load` opens the file. The file has the user's units (degrees); properties give the values
that rooms need in radians. A table of one room is that room's options struct: [publish], [tracking] and [vision] are
declared in their rooms. :mod:`fwav_companion.config.room_options` makes the options that depend on several tables.
"""

from fwav_companion.config.document import Config, RecordConfig, StateConfig, StatusConfig
from fwav_companion.config.estimation import READOUT_SIGMA_UNKNOWN_S, GroundConfig, UncertaintyConfig
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
)
from fwav_companion.config.reading import parse

__all__ = [
    "READOUT_SIGMA_UNKNOWN_S",
    "CameraConfig",
    "Config",
    "DetectionsConfig",
    "GroundConfig",
    "LinkConfig",
    "MountConfig",
    "RatesConfig",
    "RecordConfig",
    "SigningConfig",
    "StampRule",
    "StateConfig",
    "StatusConfig",
    "UncertaintyConfig",
    "VehicleConfig",
    "load",
    "load_signing_key",
    "parse",
]
