"""Gates: the largest normalised innovation squared (NIS) of a fix that may be a target's."""

from __future__ import annotations

from fwav_companion.types import Detection

GATE = 16.0
"""With 2 degrees of freedom: a true fix lies beyond it once in 3000 times."""
ID_GATE = 4.0 * GATE
"""With the detector's own id in favour: trackers swap ids, but seldom to something that far away."""


def widest_gate(detection: Detection) -> float:
    """The widest gate that applies to a detection, whatever the target."""
    return GATE if detection.detector_id is None else ID_GATE
