"""Why frames and detections that came are not used. A finding is called as the reason is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding, Level
from fwav_companion.types import Reason

SHARE: Final = 0.05
"""Of what came: a reason that costs less is a flight's daily bread."""
FEW: Final = 5
"""Frames or detections: fewer refusals are no pattern."""

REFUSALS: Final[Mapping[Reason, tuple[Level, str, str]]] = {
    Reason.MALFORMED: (
        Level.STOPS, "are no JSON of the documented form",
        "one JSON object a datagram, with detections: []",
    ),
    Reason.NO_TIME: (
        Level.STOPS, "do not tell their time once",
        "exactly one of time_unix, time_monotonic, time_boot: when the picture was taken",
    ),
    Reason.WRONG_UNITS: (
        Level.STOPS, "have stamps in other units than seconds",
        "divide: nanoseconds by 1e9 (libcamera's SensorTimestamp), microseconds by 1e6",
    ),
    Reason.NOT_FINITE: (Level.STOPS, "hold NaN or infinity", "send only finite numbers"),
    Reason.WRONG_SIZE: (
        Level.STOPS, "are of another shape than the calibration",
        "calibrate at the shape (width : height) that the detector sees, or tell the right size",
    ),
    Reason.FROM_THE_FUTURE: (
        Level.STOPS, "were captured after they arrived",
        "stamp with this board's own clock; the detector runs on another computer? then time_boot or NTP",
    ),
    Reason.ACROSS_CLOCK_STEP: (
        Level.HARMS, "were stamped across a step of the wall clock",
        "stamp with time_monotonic: it is never stepped",
    ),
    Reason.TOO_LATE: (
        Level.STOPS, "came more than 0.5 s after their capture",
        "a faster detector or a smaller image; is the stamp that of the capture?",
    ),
    Reason.STALE_ATTITUDE: (
        Level.HARMS, "had no attitude near their capture", "see what is said of rates and loss"
    ),
    Reason.OUTSIDE_IMAGE: (
        Level.HARMS, "lie outside the image", "u and v are pixels of the picture whose size is told"
    ),
    Reason.OUTSIDE_LENS: (
        Level.HARMS, "lie beyond the angle for which the lens is calibrated",
        "calibrate with the board in the image's corners too, or raise max_angle_deg where the fit is known to hold",
    ),
    Reason.LOW_SCORE: (Level.MINDS, "score below [detections] min_score", "is min_score as you want it?"),
    Reason.OTHER_LABEL: (
        Level.MINDS, "have labels that are not among [detections] labels", "are labels as you want them?"
    ),
    Reason.BEYOND_TERRAIN: (
        Level.HARMS, "look beyond the elevation model",
        "add the neighbouring files to [ground] terrain",
    ),
    Reason.TERRAIN_UNFIT: (
        Level.STOPS, "meet an elevation model that disagrees with the take-off height",
        "[ground] terrain_datum: what the files' heights are counted from",
    ),
    Reason.NO_RANGE: (
        Level.HARMS, "had no rangefinder reading at their capture",
        "see that DISTANCE_SENSOR comes, and that it looks down",
    ),
    Reason.ABOVE_HORIZON: (
        Level.HARMS, "look above the horizon",
        "is [camera.mount] right? pitch_deg = -90 looks straight down, image top to the nose",
    ),
}  # fmt: skip
"""Why frames and detections are refused: how bad that is, what they are or do, and what to change."""


def refusals(evidence: Evidence) -> Iterator[Finding]:
    """Every reason that costs more than a flight's daily bread."""
    came = max(evidence.number("intake", "came"), evidence.number("frames"), evidence.number("detections"))
    for reason, (level, what, do) in REFUSALS.items():
        count = evidence.number("dropped", reason.value)
        if count >= FEW and count > SHARE * came:
            share = 100.0 * count / came if came else 100.0
            worst = level if share > 50.0 or level is Level.MINDS else Level.HARMS
            yield Finding(reason.value, worst, "detections", f"{count:.0f} ({share:.0f} %) {what}", do)
