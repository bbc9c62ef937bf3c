"""Names of targets and results of landmarks for people, the same in report, exports and terminal. Pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from fwav_companion.recording.summary_types import ShiftObject, SummaryLine
from fwav_companion.types.flight_status import LandmarkReport


def display_name(label: str) -> str:
    """A label as a person says it: "tag36h11:19" is "tag 19"; a target without a label is "target"."""
    family, _, number = label.rpartition(":")
    if family.startswith("tag") and number.isdigit():
        return f"tag {number}"
    return label or "target"


def display_names(labels: Iterable[str]) -> dict[str, str]:
    """The name of each label; labels whose names would be equal (one number in two tag families) keep the label."""
    unique = dict.fromkeys(labels)
    count = Counter(map(display_name, unique))
    return {label: display_name(label) if count[display_name(label)] == 1 else label for label in unique}


def notice_texts(summary: SummaryLine) -> list[str]:
    """Texts of the summary's notices about the clock, the position and the camera."""
    return [each.text + (f" ({each.times} times in all)" if each.times > 1 else "") for each in summary.notices]


def shift_text(shift: ShiftObject) -> str:
    """Text on the last shift of an elevation model in the summary, and on its share in every uncertainty."""
    source, sigma_m = shift.source.replace("_", " "), shift.sigma_m
    text = f"the model is shifted by {shift.shift_m:+.1f} m, by {source}"
    if shift.source == "assumed":
        text = "the model's own heights, since the take-off height is not known"
    elif shift.source == "landmark":
        return f"{text}; its sigma of {sigma_m:.1f} m is in every claim since"
    return f"{text}; a sigma of {sigma_m:.1f} m is in every claim" if sigma_m else text


def landmark_result(landmark: LandmarkReport) -> str:
    """Text on the use of a landmark in the summary: used, left out, not seen, or not used by this filter."""
    match landmark.state:
        case "used":
            return "used"
        case "left_out":
            return f"left out: it appears {landmark.off_m:.1f} m from its place"
        case "not_applied":
            return "not used by this filter"
    return "not seen" if not landmark.refused else "not used: its sights do not agree with all else yet"
