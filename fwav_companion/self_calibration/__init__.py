"""Self-calibration as it is reported and kept between flights. The estimate is that of ``estimation``."""

from fwav_companion.self_calibration.calibration_report import (
    CalibrationReport,
    CalibrationStatus,
    KeptCalibration,
    PriorInflation,
    SharedParameter,
)

__all__ = ["CalibrationReport", "CalibrationStatus", "KeptCalibration", "PriorInflation", "SharedParameter"]
