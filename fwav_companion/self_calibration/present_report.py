"""The report of self-calibration: estimates, status, and a sentence on what the flight lacks for a calibration."""

from __future__ import annotations

from fwav_companion.self_calibration.assessment import MOUNT_OBSERVABLE, Assessment, believed
from fwav_companion.self_calibration.calibration_report import CalibrationReport, CalibrationStatus, SharedParameter
from fwav_companion.self_calibration.calibration_state import CalibrationState
from fwav_companion.self_calibration.delay_search import DelaySearch, NoDelay
from fwav_companion.types import Bias, ErrorPriors

ADVICE = "hover, turn twice, climb 5 m; or three targets"
WITHOUT_DELAY = {
    CalibrationStatus.AMBIGUOUS: "several delays explain the flight: fly turns",
    CalibrationStatus.UNEXPLAINED: "no delay explains the flight: check [uncertainty] time_offset_sigma_s",
    CalibrationStatus.WAITING: "the flight shows no delay: fly turns",
}


def report_of(state: CalibrationState) -> CalibrationReport:
    """Report of this state of self-calibration."""
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


def missing_before_assessment(search: DelaySearch | None, no_delay: NoDelay | None, attitude_hz: float | None) -> str:
    """The reason why there is no estimate yet. ``attitude_hz``: rate of attitudes if they are too slow, else None."""
    if attitude_hz is not None:
        return f"attitudes at {attitude_hz:.1f} Hz"
    if search is not None:
        sights, needed = search.progress
        return "the delay is being searched" if search.begun else f"{sights} of {needed} sights"
    if no_delay is None:
        return "no target was seen long enough with a global position"
    return WITHOUT_DELAY[no_delay.status]


def missing_of(assessment: Assessment, priors: ErrorPriors) -> str | None:
    """The reason why an assessed estimate is not calibrated; None where it is."""
    if assessment.status is CalibrationStatus.CALIBRATED:
        return None
    if assessment.mount_known <= MOUNT_OBSERVABLE:
        return "no constant mount explains the flight: check the compass and the mount's screws"
    position_m = priors.sigma(Bias.POSITION_NORTH)
    if position_m > 0.0:
        return f"a position error of {position_m:g} m hides the mount: {ADVICE}"
    return f"the mount is known to {assessment.mount_known:.0%} of its prior: {ADVICE}"
