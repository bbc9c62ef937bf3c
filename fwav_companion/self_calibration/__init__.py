"""Self-calibration: the camera's delay, its mount and the height, from targets that are seen again and again.

Pure. Reading order: ``delayed_poses``, ``pixel_measurement``, ``rate_denoiser`` (one measurement); ``joint_filter``,
``filter_pass``, ``delay_search``, ``relinearization`` (the estimate); ``innovation_consistency``, ``observability``,
``prior_inflation``, ``assessment``, ``report`` (what may be believed of it); ``prepared_measurement``;
``single_sights``, ``mount_check``; ``measurement_queue``, ``calibration_context``, ``calibrator``.
"""

from fwav_companion.self_calibration.assessment import CalibrationStatus
from fwav_companion.self_calibration.pixel_measurement import SharedParameter
from fwav_companion.self_calibration.prior_inflation import PriorInflation
from fwav_companion.self_calibration.report import CalibrationReport, KeptCalibration

__all__ = ["CalibrationReport", "CalibrationStatus", "KeptCalibration", "PriorInflation", "SharedParameter"]
