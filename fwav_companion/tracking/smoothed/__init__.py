"""The tracker by the smoother (``estimation``): association and reports by its posterior, life cycle of ``tracking``.

Reading order: ``flight_errors`` (the configuration's priors as the smoother's), ``flight_ground`` (the ground model),
``flight_samples`` (telemetry and fixes as its input), ``smoothed_target`` (its answers as targets), ``smoothed_report``
(self-calibration), ``smoothed_tracker``.
"""
