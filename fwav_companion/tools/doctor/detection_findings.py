"""Detections: why frames and detections are not used."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import Final

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding, Level
from fwav_companion.tools.doctor.finding_table import make_finding
from fwav_companion.tools.doctor.landing_findings import labels_heard
from fwav_companion.tools.reason_table import REASONS, judged_reasons
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

FILTERS: Final = (Reason.LOW_SCORE, Reason.OTHER_LABEL)
SKYWARD: Final = (Reason.ABOVE_HORIZON, Reason.TOO_SHALLOW)


def detection_findings(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    """Yield why frames and detections are not used; nothing for a relay."""
    if not evidence.config.localizes or evidence.files.calibration is None:
        return
    yield from _refused(judged_reasons("frame"), status, max(status.intake.came, status.frames), "frames")
    yield from _stamps(status)
    yield from _growing_age(status)
    yield from _refused(judged_reasons("detection"), status, judged_detections(status), "detections")
    yield from _filtered(evidence, status)


def judged_detections(status: RunStatus) -> int:
    """Return how many detections were used or refused for a reason of their own, start-up apart."""
    return status.fixes + status.refused(*judged_reasons("detection"), *FILTERS, *SKYWARD)


def _refused(reasons: Iterable[Reason], status: RunStatus, came: int, things: str) -> Iterator[Finding]:
    """The findings of the table of reasons: at the reason's level where it costs most of the ``things``."""
    for reason in reasons:
        count, entry = status.refused(reason), REASONS[reason]
        if entry.level is not None and count >= FEW and count > SHARE * came:
            level = Level(entry.level) if count > MOST * came else Level.WARNING
            text = f"{count} of {max(came, count)} {things} {entry.problem}"
            yield Finding(reason.value, level, "detections", problem=text, fix=entry.remedy)


def _stamps(status: RunStatus) -> Iterator[Finding]:
    """Stamps that are not the times at which pictures were taken."""
    heard, came = status.seen.heard, max(status.intake.came, status.frames)
    if heard.jumped_stamps >= FEW:
        yield make_finding("stamps_jump", jumps=heard.jumped_stamps, frames=came)
    elif heard.repeated_stamps >= FEW and heard.repeated_stamps > SHARE * came:
        yield make_finding("stamps_repeat", repeats=heard.repeated_stamps, frames=came)


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
        yield make_finding("stamps_drift", "slower" if drift > 0.0 else "faster", drift=abs(drift))
        return
    if len(ages_s) < 3 or ages_s[-1] - ages_s[0] < OLDER_S or any(b <= a for a, b in pairwise(ages_s)):
        return
    yield make_finding("stamps_grow_old", first_s=ages_s[0], last_s=ages_s[-1])


def _filtered(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    """A filter that passes nothing is an error; one that removes most is noted."""
    judged, low, other = judged_detections(status), status.refused(Reason.LOW_SCORE), status.refused(Reason.OTHER_LABEL)
    share, least = ("all", SHARE) if judged - low - other <= PASSED * judged else ("most", MOST)
    detections, best = evidence.config.detections, status.seen.heard.best_score
    if low >= FEW and low > least * judged:
        yield make_finding(
            "low_score",
            share,
            "lower" if best is None or share == "most" else "below_best",
            count=low,
            judged=judged,
            min_score=detections.min_score,
            best=best,
        )
    if other >= FEW and other > least * judged:
        labels = ", ".join(f'"{label}"' for label in detections.labels)
        yield make_finding("other_label", share, count=other, judged=judged, labels=labels, heard=labels_heard(status))
