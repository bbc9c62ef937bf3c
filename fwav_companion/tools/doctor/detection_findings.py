"""Detections: why frames and detections are not used."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Final

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding, Level
from fwav_companion.tools.doctor.landing_findings import labels_heard
from fwav_companion.types import Reason
from fwav_companion.types.status import RunStatus

SHARE: Final = 0.05
"""Least share of frames or detections that a reported reason costs: less is normal in flight."""
MOST: Final = 0.5
FEW: Final = 5
"""Least number of refused frames or detections that is a pattern."""
PASSED: Final = 0.01
"""Share of detections: a filter that passes no more than this passes nothing."""
OLDER_S: Final = 0.02
"""Least growth of the minimum age over the windows, seconds: jitter leaves less in a minimum of sixty frames."""
WINDOW_S: Final = 2.0
"""Time between two of these ages, seconds."""
MOST_DRIFT: Final = 0.03
"""Largest rate error of a clock: a queue that builds up mostly grows faster."""

FRAME_REFUSALS: Final[Mapping[Reason, tuple[Level, str, str]]] = {
    Reason.MALFORMED: (
        Level.ERROR,
        "are not JSON of the documented form",
        "one JSON object a datagram, with detections: []",
    ),
    Reason.NO_TIME: (
        Level.ERROR,
        "do not hold exactly one time",
        "one of time_unix, time_monotonic, time_boot: when the picture was taken",
    ),
    Reason.WRONG_UNITS: (
        Level.ERROR,
        "have stamps in other units than seconds",
        "divide: milliseconds by 1e3, microseconds by 1e6, nanoseconds (libcamera's SensorTimestamp) by 1e9",
    ),
    Reason.WRONG_SIZE: (
        Level.ERROR,
        "are of another shape than the calibration",
        "calibrate at the shape (width : height) that the detector sees, or send the right size",
    ),
    Reason.TOO_MANY_DETECTIONS: (
        Level.ERROR,
        "have more than 256 detections",
        "let the detector send its 256 best: a threshold of the score, and non-maximum suppression",
    ),
    Reason.DUPLICATE_FRAME: (
        Level.ERROR,
        "have the number and the time of an earlier one",
        "send each frame once, with the time of its own capture; check that no second detector sends here",
    ),
    Reason.FROM_THE_FUTURE: (
        Level.ERROR,
        "have stamps later than their arrival",
        "stamp with this board's own clock; a detector on another computer: time_boot or NTP",
    ),
    Reason.ACROSS_CLOCK_STEP: (
        Level.WARNING,
        "were stamped across a step of the wall clock",
        "stamp with time_monotonic: it is never stepped",
    ),
    Reason.OVERLOAD: (
        Level.WARNING,
        "came faster than this board handles them",
        "send fewer frames, or fewer detections in each ([detections] min_score, labels)",
    ),
    Reason.TOO_LATE: (
        Level.ERROR,
        "arrived more than 0.5 s after their capture, or 2.5 s where LANDING_TARGET is sent",
        "a faster detector or a smaller image; check that the stamp is that of the capture",
    ),
}
"""Findings by the reason for which frames are refused: level, what these frames are or do, and what to change."""
DETECTION_REFUSALS: Final[Mapping[Reason, tuple[Level, str, str]]] = {
    Reason.NOT_FINITE: (Level.ERROR, "hold NaN or infinity", "send only finite numbers"),
    Reason.STALE_ATTITUDE: (
        Level.WARNING,
        "had no attitude near their capture",
        "see the findings about rates and loss; gaps of the link and reboots of the autopilot do the same",
    ),
    Reason.ATTITUDE_GAP: (
        Level.WARNING,
        "were taken where attitudes are too far apart for the vehicle's motion",
        "[rates] attitude higher, ten times the flapping at least; see the findings about rates and loss",
    ),
    Reason.OUTSIDE_IMAGE: (
        Level.WARNING,
        "lie outside the image",
        "u and v are pixels of the picture whose size is sent",
    ),
    Reason.OUTSIDE_LENS: (
        Level.WARNING,
        "lie beyond the angle for which the lens is calibrated",
        "calibrate with the board in the image's corners too, or raise max_angle_deg where the fit is known to hold",
    ),
    Reason.BEYOND_TERRAIN: (
        Level.WARNING,
        "look beyond the elevation model",
        "add the neighbouring files to [ground] terrain",
    ),
    Reason.NO_TERRAIN: (
        Level.WARNING,
        "meet a void of the elevation model",
        "use files without voids in [ground] terrain, or a coarser file beside them",
    ),
    Reason.TERRAIN_UNFIT: (
        Level.ERROR,
        "meet an elevation model that disagrees with the take-off height",
        "[ground] terrain_datum: the datum of the files' heights",
    ),
    Reason.NO_RANGE: (
        Level.WARNING,
        "had no rangefinder reading at their capture",
        "check that DISTANCE_SENSOR arrives, and that the rangefinder looks down",
    ),
}
"""Findings by the reason for which single detections are refused, in the same form."""
FILTERS: Final = (Reason.LOW_SCORE, Reason.OTHER_LABEL)
SKYWARD: Final = (Reason.ABOVE_HORIZON, Reason.TOO_SHALLOW)


def detection_findings(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    """Yield why frames and detections are not used; nothing for a relay."""
    if not evidence.config.localizes or evidence.files.calibration is None:
        return
    yield from _refused(FRAME_REFUSALS, status, max(status.intake.came, status.frames), "frames")
    yield from _stamps(status)
    yield from _growing_age(status)
    yield from _refused(DETECTION_REFUSALS, status, judged_detections(status), "detections")
    yield from _filtered(evidence, status)


def judged_detections(status: RunStatus) -> int:
    """Return how many detections were used or refused for a reason of their own, start-up apart."""
    return status.fixes + status.refused(*DETECTION_REFUSALS, *FILTERS, *SKYWARD)


def _refused(
    refusals: Mapping[Reason, tuple[Level, str, str]], status: RunStatus, came: int, things: str
) -> Iterator[Finding]:
    for reason, (level, problem, fix) in refusals.items():
        count = status.refused(reason)
        if count >= FEW and count > SHARE * came:
            most = count > MOST * came
            text = f"{count} of {max(came, count)} {things} {problem}"
            yield Finding(reason.value, level if most else Level.WARNING, "detections", problem=text, fix=fix)


def _stamps(status: RunStatus) -> Iterator[Finding]:
    """Stamps that are not the times at which pictures were taken."""
    heard, came = status.seen.heard, max(status.intake.came, status.frames)
    if heard.jumped_stamps >= FEW:
        yield Finding(
            "stamps_jump",
            Level.ERROR,
            "detections",
            problem=f"stamps jump back and forth: {heard.jumped_stamps} times in {came} frames",
            fix="stamp with time_monotonic, which is never set; check that no second detector sends here",
        )
    elif heard.repeated_stamps >= FEW and heard.repeated_stamps > SHARE * came:
        yield Finding(
            "stamps_repeat",
            Level.ERROR,
            "detections",
            problem=f"{heard.repeated_stamps} of {came} frames have the stamp of the frame before",
            fix="read the clock for each picture, when it is taken; check that no second detector sends here",
        )


def _drift(status: RunStatus) -> float | None:
    """Rate at which the stamps' ages grow, seconds a second; None where they do not grow or fall steadily."""
    ages_s = status.seen.heard.stamp_ages_s
    steps_s = [b - a for a, b in pairwise(ages_s)]
    if len(steps_s) < 2 or abs(ages_s[-1] - ages_s[0]) < OLDER_S:
        return None
    least_s, most_s = min(map(abs, steps_s)), max(map(abs, steps_s))
    if any(step_s * steps_s[0] <= 0.0 for step_s in steps_s) or most_s > 2.0 * least_s:
        return None
    return (ages_s[-1] - ages_s[0]) / (len(steps_s) * WINDOW_S)


def _growing_age(status: RunStatus) -> Iterator[Finding]:
    """A clock of another rate, or a queue that builds up in the detector."""
    ages_s, drift = status.seen.heard.stamp_ages_s, _drift(status)
    if drift is not None and abs(drift) <= MOST_DRIFT:
        yield Finding(
            "stamps_drift",
            Level.WARNING,
            "detections",
            problem=f"the stamps' clock is {abs(drift):.1%} {'slower' if drift > 0.0 else 'faster'} than this board's",
            fix="stamp with this board's own clock; a detector on another computer: time_boot or NTP"
            + ("; or the detector falls behind by as much: let it drop frames" if drift > 0.0 else ""),
        )
        return
    if len(ages_s) < 3 or ages_s[-1] - ages_s[0] < OLDER_S or any(b <= a for a, b in pairwise(ages_s)):
        return
    yield Finding(
        "stamps_grow_old",
        Level.WARNING,
        "detections",
        problem=f"frames arrive later and later after their stamps: {ages_s[0]:.2f} s, then {ages_s[-1]:.2f} s",
        fix="let the detector drop frames instead of queueing them (smaller image, lower fps); on another computer "
        "its clock runs at another rate: NTP, or time_boot",
    )


def _filtered(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    """A filter that passes nothing is an error; one that removes most is noted."""
    judged, low, other = judged_detections(status), status.refused(Reason.LOW_SCORE), status.refused(Reason.OTHER_LABEL)
    level = Level.ERROR if judged - low - other <= PASSED * judged else Level.NOTE
    least = MOST * judged if level is Level.NOTE else SHARE * judged
    detections, best = evidence.config.detections, status.seen.heard.best_score
    if low >= FEW and low > least:
        yield Finding(
            Reason.LOW_SCORE.value,
            level,
            "[detections] min_score",
            problem=f"{low} of {judged} detections score below min_score = {detections.min_score:g}"
            + ("" if best is None else f"; the best scored {best:.2f}"),
            fix="lower min_score" if best is None or level is Level.NOTE else f"set min_score below {best:.2f}",
        )
    if other >= FEW and other > least:
        labels = ", ".join(f'"{label}"' for label in detections.labels)
        yield Finding(
            Reason.OTHER_LABEL.value,
            level,
            "[detections] labels",
            problem=f"{other} of {judged} detections are not labelled {labels}; heard: {labels_heard(status)}",
            fix="add the label that is wanted, or set labels = [] for all",
        )
