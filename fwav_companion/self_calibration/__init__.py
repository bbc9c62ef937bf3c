"""Self-calibration: the camera's delay, its mount and the height, from targets that are seen repeatedly.

Pure. In numpy, except for ``calibration_report``: the daemon imports the other modules only where it is switched on.
Reading order: ``delayed_poses``, ``pixel_measurement``, ``rate_denoiser`` (the measurement); ``joint_filter``,
``filter_pass``, ``delay_search``, ``relinearization`` (the estimate); ``innovation_consistency``, ``observability``,
``prior_inflation``, ``assessment`` (what is believed of it); ``sights``, ``mount_check``; ``measurement_queue``,
``calibration_context``, ``calibrator``.
"""

from fwav_companion.self_calibration.calibration_report import (
    CalibrationReport,
    CalibrationStatus,
    KeptCalibration,
    PriorInflation,
    SharedParameter,
)

__all__ = ["CalibrationReport", "CalibrationStatus", "KeptCalibration", "PriorInflation", "SharedParameter"]
