"""The smoother's shared parameters as the report of self-calibration."""

from __future__ import annotations

from collections.abc import Sequence
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
from fwav_companion.estimation.estimator import REFUSED_WEIGHT, Estimator
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.self_calibration import CalibrationReport, CalibrationStatus, KeptCalibration, PriorInflation
from fwav_companion.self_calibration.calibration_report import SharedParameter
from fwav_companion.tracking.smoothed.parameter_reports import camera_statuses, parameter_reports
from fwav_companion.tracking.smoothed.stored_calibration import StoredCalibration
from fwav_companion.types.flight_status import ParameterReport

_NAMED = {CAMERA_DELAY: SharedParameter.DELAY, HEIGHT: SharedParameter.HEIGHT} | {
    MOUNT.start + k: SharedParameter(SharedParameter.MOUNT_X + k) for k in range(3)
}
"""Parameters whose contradicted priors are reported, and their numbers there."""
NEVER_SOLVED = "no target was seen long enough with a global position"
WRONG_MOUNT = "the mount is wrong: correct it first"
REFUSES = "half of the sightings fit no estimate: check the camera's calibration and mount, and [ground] model"


def smoothed_report(
    estimator: Estimator, host_ns: HostNs, mistake: str = "", *, stored: StoredCalibration | None = None
) -> CalibrationReport:
    """The report now. The mount is reported as a correction, the opposite of the smoother's sign.

    Its x and y count what the attitude is tilted: that is what the configuration must turn. ``mistake``: that of the
    mount in words; nothing is known then. ``stored``: the calibration of an earlier flight.
    """
    statuses = camera_statuses(estimator, None if stored is None else stored.configured)
    parameters = parameter_reports(statuses)
    delay, height, (x, y, z) = statuses[CAMERA_DELAY], statuses[HEIGHT], statuses[MOUNT]
    rivals = tuple(estimator.rival_delays()) if not delay.is_known else ()
    status, reason = _status(estimator, statuses, parameters, is_ambiguous=len(rivals) > 1)
    if mistake:
        status, reason = CalibrationStatus.WAITING, WRONG_MOUNT
    return CalibrationReport(
        host_ns=host_ns,
        time_offset_s=delay.estimate,
        time_offset_sigma_s=delay.sigma,
        mount=(-x.estimate, -y.estimate, -z.estimate),
        mount_sigma=(x.sigma, y.sigma, z.sigma),
        height_m=height.estimate,
        height_sigma_m=height.sigma,
        mistake=mistake,
        replaced=stored is not None and stored.dropped,
        status=status,
        reason=reason,
        alternatives=rivals if status is CalibrationStatus.AMBIGUOUS else (),
        denied=tuple(_inflation(i, s) for i, s in enumerate(statuses) if s.status == "contradicts" and i in _NAMED),
        keep=_kept(statuses) if status is CalibrationStatus.CALIBRATED else None,
        parameters=parameters,
    )


def _status(
    estimator: Estimator, statuses: Sequence[ParameterStatus], parameters: Sequence[ParameterReport],
    *, is_ambiguous: bool,
) -> tuple[CalibrationStatus, str | None]:  # fmt: skip
    if not estimator.solves or estimator.model.consider:
        return CalibrationStatus.WAITING, NEVER_SOLVED
    needed = (parameters[CAMERA_DELAY], *parameters[MOUNT])
    missing = [p for p in parameters if p.status == "contradicts"] or [p for p in needed if p.status == "waiting"]
    if not missing:
        return CalibrationStatus.CALIBRATED, None
    reason = f"{missing[0].name}: {missing[0].reason}"
    if is_ambiguous:
        return CalibrationStatus.AMBIGUOUS, reason
    if estimator.estimate.weight < REFUSED_WEIGHT and missing[0].status == "waiting":
        reason = REFUSES
    # A delay beyond its prior is known as well: it is what the configuration must say.
    delay = statuses[CAMERA_DELAY]
    known = delay.status == "calibrated" or delay.is_known
    return (CalibrationStatus.TIME if known else CalibrationStatus.WAITING), reason


def _inflation(index: int, status: ParameterStatus) -> PriorInflation:
    """A contradicted prior; of the mount as a correction."""
    sign = -1.0 if MOUNT.start <= index < MOUNT.stop else 1.0
    return PriorInflation(_NAMED[index], sign * status.prior_mean, status.prior_sigma, sign * status.alone)


def _kept(statuses: Sequence[ParameterStatus]) -> KeptCalibration:
    """What the next flight starts with, and widens by what changes meanwhile; its heading error is another."""
    delay, heading, late = (statuses[i] for i in (CAMERA_DELAY, HEADING, POSITION_DELAY))
    (x, y, z), (first, second, third) = statuses[MOUNT], statuses[LEVER]
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
