"""From ground fixes to targets: filters, association, the life of a track, late frames put back in their place.

Pure: frames come in with their own capture times, tracks go out. Reading order: ``options``, ``base``, ``estimate``,
``kalman``, ``lowpass``, ``moving``; ``association``, ``lifecycle``, ``alive``, ``doubles``, ``tracker``, ``making``,
``reorder``; and for self-calibration the folder ``calibration``.
"""

from fwav_companion.tracking.calibration.loosening import Loosening
from fwav_companion.tracking.calibration.rays import Common
from fwav_companion.tracking.calibration.report import CalibrationReport, KeptCalibration
from fwav_companion.tracking.calibration.verdict import CalibrationStatus
from fwav_companion.tracking.making import make_tracker, tracker_with
from fwav_companion.tracking.options import TrackingOptions
from fwav_companion.tracking.reorder import Reorder, Settled
from fwav_companion.tracking.tracker import Tracker

__all__ = [
    "CalibrationReport",
    "CalibrationStatus",
    "Common",
    "KeptCalibration",
    "Loosening",
    "Reorder",
    "Settled",
    "Tracker",
    "TrackingOptions",
    "make_tracker",
    "tracker_with",
]
