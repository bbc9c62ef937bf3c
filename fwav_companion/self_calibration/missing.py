"""What a flight lacks for a calibration, as a text for people: the reason of every status but ``calibrated``."""

from __future__ import annotations

from fwav_companion.self_calibration.assessment import MOUNT_OBSERVABLE, Assessment
from fwav_companion.self_calibration.calibration_report import CalibrationStatus
from fwav_companion.self_calibration.delay_search import DelaySearch, NoDelay
from fwav_companion.types import Bias, ErrorPriors

ADVICE = "hover, turn twice, climb 5 m; or three targets"
WITHOUT_DELAY = {
    CalibrationStatus.AMBIGUOUS: "several delays explain the flight: fly turns",
    CalibrationStatus.UNEXPLAINED: "no delay explains the flight: check [uncertainty] time_offset_sigma_s",
    CalibrationStatus.WAITING: "the flight shows no delay: fly turns",
}


def missing_before_assessment(search: DelaySearch | None, no_delay: NoDelay | None, attitude_hz: float | None) -> str:
    """The reason while there is no estimate. ``attitude_hz``: rate of attitudes that are too slow, else None."""
    if attitude_hz is not None:
        return f"attitudes at {attitude_hz:.1f} Hz"
    if search is not None:
        sights, needed = search.progress
        return "the delay is being searched" if search.begun else f"{sights} of {needed} sights"
    return "no target was seen long enough" if no_delay is None else WITHOUT_DELAY[no_delay.status]


def missing_of(assessment: Assessment, priors: ErrorPriors) -> str | None:
    """The reason of an estimate's status; None where it is calibrated."""
    if assessment.status is CalibrationStatus.CALIBRATED:
        return None
    if assessment.mount_known <= MOUNT_OBSERVABLE:
        return "no constant mount explains the flight: check the compass and the mount's screws"
    position_m = priors.sigma(Bias.POSITION_NORTH)
    if position_m > 0.0:
        return f"a position error of {position_m:g} m hides the mount: {ADVICE}"
    return f"the mount is known to {assessment.mount_known:.0%} of its prior: {ADVICE}"
