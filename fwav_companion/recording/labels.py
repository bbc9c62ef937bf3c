"""Names of targets and results of landmarks for people, alike in report, exports and terminal. Pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any


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


def landmark_result(landmark: Mapping[str, Any]) -> str:
    """What a landmark of the summary did: used, left out, not seen, or not used by this filter."""
    match landmark["state"]:
        case "used":
            return "used"
        case "left_out":
            return f"left out: it appears {landmark['off_m']:.1f} m from its place"
        case "not_applied":
            return "not used by this filter"
    return "not seen" if not landmark["refused"] else "not used: its sights do not agree with all else yet"
