"""Names of targets for people, alike in the report, in exports and on the terminal. Pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable


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
