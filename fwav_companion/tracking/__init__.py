"""From ground fixes to targets: filters, association, the life of a track, late frames put back in their place.

Pure: frames come in with their own capture times, tracks go out. Reading order: ``options``, ``base``, ``estimate``,
``kalman``, ``lowpass``, ``moving``; ``association``, ``lifecycle``, ``alive``, ``doubles``, ``tracker``, ``making``,
``reorder``; and for self-calibration the folder ``calibration``.
"""

from fwav_companion.self_calibration.assessment import CalibrationStatus
from fwav_companion.self_calibration.pixel_measurement import SharedParameter
from fwav_companion.self_calibration.prior_inflation import PriorInflation
from fwav_companion.self_calibration.report import CalibrationReport, KeptCalibration
from fwav_companion.tracking.filter_factory import make_tracker, tracker_with
from fwav_companion.tracking.options import TrackingOptions
from fwav_companion.tracking.reorder import Reorder, Settled
from fwav_companion.tracking.tracker import Tracker

__all__ = [
    "CalibrationReport",
    "CalibrationStatus",
    "KeptCalibration",
    "PriorInflation",
    "Reorder",
    "Settled",
    "SharedParameter",
    "Tracker",
    "TrackingOptions",
    "make_tracker",
    "tracker_with",
]
