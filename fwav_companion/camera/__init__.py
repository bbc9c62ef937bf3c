"""Lens models and calibration files' content. Pure; numpy only in :mod:`fwav_companion.camera.batch`."""

from fwav_companion.camera.calibration import Calibration, parse_calibration
from fwav_companion.camera.kannala_brandt import KannalaBrandt

__all__ = ["Calibration", "KannalaBrandt", "parse_calibration"]
