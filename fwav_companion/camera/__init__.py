"""Lens models and calibration files' content. Pure; numpy only in ``batch`` and ``fitting``."""

from fwav_companion.camera.brown_conrady import BrownConrady
from fwav_companion.camera.calibration import Calibration, parse_calibration
from fwav_companion.camera.kannala_brandt import KannalaBrandt

__all__ = ["BrownConrady", "Calibration", "KannalaBrandt", "parse_calibration"]
