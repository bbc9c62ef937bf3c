"""Judges the first detections of a model: a wrong layout often gives outputs that no picture can have. PURE."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np

from fwav_companion.vision.detectors.model.boxes import Boxes
from fwav_companion.vision.detectors.model.decoders import Reading
from fwav_companion.vision.detectors.model.facts import Outputs
from fwav_companion.vision.detectors.model.layouts import LAYOUTS, Layout

SCORE_SLACK: Final = 0.01
"""Largest excess of a score above 1: half precision rounds."""
BEYOND: Final = 0.25
"""Share of the input's side by which a box may end beyond it: models draw cut things to their true end."""
FEWEST: Final = 5
"""Least number of boxes of which a corner is a pattern."""
CORNER: Final = 0.1
"""Side of a corner as a share of the input."""
MOST_CHECKED: Final = 1000


def implausible(boxes: Boxes, size: tuple[int, int], confidence: float) -> str:
    """What no picture can have in these detections, in the model's input; "" where nothing is wrong."""
    scores = boxes.scores[np.isfinite(boxes.scores)]
    if len(scores) and scores.max() > 1.0 + SCORE_SLACK:
        return f"scores up to {scores.max():.3g}; a score is at most 1"
    if len(scores) and scores.min() < -SCORE_SLACK:
        return f"scores down to {scores.min():.3g}; a score is at least 0"
    used = boxes.where((boxes.scores >= confidence) & np.isfinite(boxes.edges).all(axis=1))
    edges = used.edges[np.argsort(-used.scores, kind="stable")[:MOST_CHECKED]] / np.array(size * 2)
    if not len(edges):
        return ""
    beyond = ((edges[:, :2] < -BEYOND) | (edges[:, 2:] > 1.0 + BEYOND)).any(axis=1)
    if beyond.mean() > 0.5:
        return f"{int(beyond.sum())} of {len(edges)} boxes end far beyond the picture"
    inverted = (edges[:, 2:] <= edges[:, :2]).any(axis=1)
    if inverted.mean() > 0.5:
        return f"{int(inverted.sum())} of {len(edges)} boxes end before they begin"
    centres = 0.5 * (edges[:, :2] + edges[:, 2:])
    distinct = len(np.unique(np.round(centres, 4), axis=0))
    if distinct >= FEWEST and (((centres < CORNER) | (centres > 1.0 - CORNER)).all(axis=0)).all():
        spread = np.ptp(centres, axis=0)
        if (spread < CORNER).all():
            return f"all {len(edges)} boxes lie in one corner of the picture"
    return ""


def sensible_formats(outputs: Outputs, reading: Reading, used: Layout, confidence: float) -> list[str]:
    """The values of model_format with which the same outputs would make sense."""
    sensible = []
    for layout in LAYOUTS:
        if layout.name == used.name or not layout.matches(reading.facts, outputs):
            continue
        try:
            boxes = layout.decode(outputs, Reading(reading.facts, layout.family.background, layout.activation))
        except (ValueError, IndexError, KeyError, StopIteration):
            continue
        if not implausible(boxes, reading.size, confidence):
            sensible.append(layout.family.name)
    return list(dict.fromkeys(sensible))


def advice(problem: str, formats: Iterable[str], used: Layout, preset: str) -> str:
    """The problem with what to change."""
    formats = list(formats)
    change = (
        f"model_format = {' | '.join(formats)} would make sense of it"
        if formats
        else "no other model_format would make sense of it: check model_normalize, and how the file was exported"
    )
    return f"{problem}, read as {used.family.name} ({preset}); {change}"
