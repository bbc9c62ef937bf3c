"""The smoother's shared parameters as the report of self-calibration."""

from __future__ import annotations

from math import hypot

from fwav_companion.estimation.answers import ParameterStatus
from fwav_companion.estimation.errors import (
    CAMERA_DELAY,
    HEADING,
    HEIGHT,
    LEVER,
    MOUNT,
    POSITION_DELAY,
)
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.self_calibration import CalibrationReport, CalibrationStatus, KeptCalibration, PriorInflation
from fwav_companion.self_calibration.calibration_report import SharedParameter

_NAMED = {CAMERA_DELAY: SharedParameter.DELAY, HEIGHT: SharedParameter.HEIGHT} | {
    MOUNT.start + k: SharedParameter(SharedParameter.MOUNT_X + k) for k in range(3)
}
"""Parameters whose contradicted priors are reported, and their numbers there."""


def smoothed_report(estimator: Estimator, host_ns: HostNs) -> CalibrationReport:
    """The report now. The mount is reported as a correction, the opposite of the smoother's sign.

    Its x and y count what the attitude is tilted: that is what the configuration must turn.
    """
    statuses = estimator.self_calibration()
    delay, height, z = statuses[CAMERA_DELAY], statuses[HEIGHT], statuses[MOUNT][2]
    x, y = estimator.camera_tilt()
    status, reason = _status(estimator, statuses)
    return CalibrationReport(
        host_ns=host_ns,
        time_offset_s=delay.estimate,
        time_offset_sigma_s=delay.sigma,
        mount=(-x.estimate, -y.estimate, -z.estimate),
        mount_sigma=(x.sigma, y.sigma, z.sigma),
        height_m=height.estimate,
        height_sigma_m=height.sigma,
        status=status,
        reason=reason,
        denied=tuple(
            PriorInflation(_NAMED[i], s.prior_mean, s.prior_sigma, s.estimate)
            for i, s in enumerate(statuses)
            if s.status == "contradicts" and i in _NAMED
        ),
        keep=_kept(statuses, x, y) if status is CalibrationStatus.CALIBRATED else None,
    )


def _status(estimator: Estimator, statuses: tuple[ParameterStatus, ...]) -> tuple[CalibrationStatus, str | None]:
    if estimator.live is None:
        return CalibrationStatus.WAITING, "no target was seen long enough with a global position"
    needed = (statuses[CAMERA_DELAY], *estimator.camera_tilt(), statuses[MOUNT][2])
    missing = [s for s in statuses if s.status == "contradicts"] or [s for s in needed if s.status == "waiting"]
    if not missing:
        return CalibrationStatus.CALIBRATED, None
    reason = f"{missing[0].name}: {missing[0].reason}"
    known = statuses[CAMERA_DELAY].status == "calibrated"
    return (CalibrationStatus.TIME if known else CalibrationStatus.WAITING), reason


def _kept(statuses: tuple[ParameterStatus, ...], x: ParameterStatus, y: ParameterStatus) -> KeptCalibration:
    """What the next flight starts with, and widens by what changes meanwhile; its heading error is another."""
    delay, heading, z, late = (statuses[i] for i in (CAMERA_DELAY, HEADING, MOUNT.start + 2, POSITION_DELAY))
    first, second, third = statuses[LEVER]
    return KeptCalibration(
        time_offset_s=delay.estimate,
        time_offset_sigma_s=delay.sigma,
        mount=(-x.estimate, -y.estimate, -z.estimate),
        mount_sigma=(x.sigma, y.sigma, hypot(z.sigma, heading.sigma)),
        position_delay_s=late.estimate,
        position_delay_sigma_s=late.sigma,
        lever_m=(first.estimate, second.estimate, third.estimate),
        lever_sigma_m=(first.sigma, second.sigma, third.sigma),
    )
