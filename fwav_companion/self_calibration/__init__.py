"""Self-calibration: estimates the camera's delay, its mount and the height from targets that are seen repeatedly.

Observability: turning that changes within a second shows the delay. One target shows the mount times the height minus
the position error. Turns separate errors fixed to the body from errors fixed to the ground, a descent separates the
mount from a position error that wanders slower, and the differences of three targets cancel the position error.
Heading, position delay and lever arm are hardly separable from the mount: they are estimated with it, by their priors.
The error of the vehicle's position is estimated as it wanders; the height is then a consider parameter, until three
targets show it.

Pure. In numpy, except for ``calibration_report`` and ``position_path``: the daemon imports the other modules only if
self-calibration is switched on.
Reading order: ``delayed_poses``, ``measurement_batch``, ``pixel_measurement``, ``position_path``, ``rate_denoiser``,
``vehicle_motion`` (the measurement); ``position_error``, ``joint_filter``, ``pixel_innovations``, ``ground_points``,
``baseline``, ``filter_pass``, ``delay_search``, ``reassociation``, ``relinearization`` (the estimate);
``innovation_consistency``, ``posterior``, ``prior_inflation``, ``calibrated_fix``, ``calibrated_places``,
``assessment`` (its assessment); ``sights``, ``mount_search``, ``named_mounts``, ``mount_check`` (a mount that is wrong
altogether); ``measurement_queue``, ``frame_fixes``, ``calibration_context``, ``mean_axes``, ``calibration_state``,
``present_report``, ``calibrator``. ``arrays`` has the vector algebra of all modules.
"""

from fwav_companion.self_calibration.calibration_report import (
    CalibrationReport,
    CalibrationStatus,
    KeptCalibration,
    PriorInflation,
    SharedParameter,
)

__all__ = ["CalibrationReport", "CalibrationStatus", "KeptCalibration", "PriorInflation", "SharedParameter"]
