"""The rules of [[pad]]: each tag once, on one pad, at a place of its own. Each error names the key to change."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import hypot
from typing import Final

from fwav_companion.config.document import Document
from fwav_companion.config.key_errors import Complaint
from fwav_companion.tracking.options import TrackingOptions
from fwav_companion.types import Pad, PadTag

SAME_PLACE_M: Final = 0.001
"""Distance below which two tags of a pad are at one place, metres: less than a print is placed by hand."""
LARGEST_INNER: Final = 0.5
"""Largest side of a tag in the blank of another over that tag's side: a larger one would cover its code."""


def pad_complaints(document: Document) -> Iterator[Complaint]:
    """Each rule of pads that the document breaks, in the file's order."""
    taken = {
        "[[target]]": frozenset(target.label for target in document.target),
        "[[landmark]]": frozenset(landmark.label for landmark in document.landmark),
    }
    labels = [pad.label for pad in document.pad]
    owners: dict[str, int] = {}
    for index, pad in enumerate(document.pad):
        if pad.label in labels[:index]:
            yield ("pad", index, "label"), "another [[pad]] has this label; accepted: a label of its own"
        for table in _tables_with(pad.label, taken):
            yield ("pad", index, "label"), f"a {table} has this label; accepted: a label of its own"
        if not pad.tags:
            yield ("pad", index, "tags"), "accepted: a list of at least one tag"
        if fault := motion_fault(pad.motion, document.tracking):
            yield ("pad", index, "motion"), fault
        yield from _tags(index, pad, owners, taken)


def motion_fault(motion: str | None, tracking: TrackingOptions) -> str:
    """Why the targets of one label cannot have a motion of their own; "" where they can."""
    if motion in (None, tracking.motion) or tracking.filter == "kalman":
        return ""
    return f'filter = "{tracking.filter}" takes all targets as [tracking] motion; accepted: "{tracking.motion}"'


def _tags(index: int, pad: Pad, owners: dict[str, int], taken: Mapping[str, frozenset[str]]) -> Iterator[Complaint]:
    """The rules of a pad's tags. ``owners``: the pads of the tags so far, to which these are added."""
    for number, tag in enumerate(pad.tags):
        path = ("pad", index, "tags", number)
        if tag.label in owners:
            whose = "this [[pad]]" if owners[tag.label] == index else f"[[pad]] {owners[tag.label] + 1}"
            yield (*path, "label"), f"{whose} has this tag already; accepted: each tag once"
        owners.setdefault(tag.label, index)
        for table in _tables_with(tag.label, taken):
            yield (*path, "label"), f"a {table} has this label; accepted: a tag that is of this pad alone"
        other = _covered(tag, pad.tags[:number])
        if other is not None:
            fault = f"{other.label} is at this place; accepted: a place of its own, or in another's blank"
            yield (*path, "at_m"), f"{fault} with at most half of its size"


def _tables_with(label: str, taken: Mapping[str, frozenset[str]]) -> list[str]:
    return [table for table, labels in taken.items() if label in labels]


def _covered(tag: PadTag, others: Sequence[PadTag]) -> PadTag | None:
    """The earlier tag at the place of this one, unless the smaller of the two fits into the blank of the larger."""
    for other in others:
        smaller_m, larger_m = sorted((tag.size_m, other.size_m))
        apart_m = hypot(tag.at_m[0] - other.at_m[0], tag.at_m[1] - other.at_m[1])
        if apart_m < SAME_PLACE_M and smaller_m > LARGEST_INNER * larger_m:
            return other
    return None
