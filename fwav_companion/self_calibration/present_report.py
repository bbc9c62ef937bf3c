"""The report of a calibrator: what it believes, its status, and what is missing. PURE."""

from __future__ import annotations

from fwav_companion.self_calibration.assessment import believed
from fwav_companion.self_calibration.calibration_report import CalibrationReport, CalibrationStatus, SharedParameter
from fwav_companion.self_calibration.calibration_state import CalibrationState
from fwav_companion.self_calibration.missing import missing_before_assessment, missing_of


def report_of(state: CalibrationState) -> CalibrationReport:
    """The report of this state."""
    means, sigmas = believed(state.assessment, state.context.shared_priors, state.stamp_sigma_s)
    return CalibrationReport(
        host_ns=state.host_ns,
        time_offset_s=means[SharedParameter.DELAY],
        time_offset_sigma_s=sigmas[SharedParameter.DELAY],
        mount=(means[1], means[2], means[3]),
        mount_sigma=(sigmas[1], sigmas[2], sigmas[3]),
        height_m=means[SharedParameter.HEIGHT],
        height_sigma_m=sigmas[SharedParameter.HEIGHT],
        status=_status(state),
        reason=_missing(state),
        alternatives=() if state.no_delay is None else state.no_delay.alternatives,
        mistake=state.mistake,
        denied=state.denied,
        replaced=state.replaced,
        keep=None if state.assessment is None else state.assessment.keep,
    )


def _status(state: CalibrationState) -> CalibrationStatus:
    if state.assessment is not None:
        return state.assessment.status
    return CalibrationStatus.WAITING if state.no_delay is None else state.no_delay.status


def _missing(state: CalibrationState) -> str | None:
    if state.mistake:
        return f"camera mount: {state.mistake}"
    if state.assessment is None:
        return missing_before_assessment(state.search, state.no_delay, state.slow_attitude_hz)
    return missing_of(state.assessment, state.context.priors)
