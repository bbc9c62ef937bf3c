"""The rooms that one camera's frames pass, made at the start of a flight or after faults that repeat. Pure."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import msgspec

from fwav_companion.localization import LandmarkSights, Localizer
from fwav_companion.pairing import Pairer
from fwav_companion.pipeline.fix_agreement import FixAgreement
from fwav_companion.pipeline.pad_notices import PadJoiner
from fwav_companion.pipeline.readout_advice import ReadoutAdvice
from fwav_companion.self_calibration import KeptCalibration
from fwav_companion.tracking import Reorder


class CameraParts(msgspec.Struct, frozen=True):
    """The rooms of a camera's pipeline: all that it knows of the flight."""

    pairer: Pairer
    localizer: Localizer
    reorder: Reorder
    agreement: FixAgreement
    """Compares fixes for the status."""
    readout: ReadoutAdvice
    """Decides whether the unknown readout limits the accuracy."""
    landmarks: LandmarkSights
    pads: PadJoiner | None = None
    """None without a pad and without a tag of known size."""


MakeParts: TypeAlias = Callable[[KeptCalibration | None], CameraParts]
"""Makes the rooms at the start of a flight; from the calibration of an earlier one, where there is one."""
