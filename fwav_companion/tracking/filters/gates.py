"""How far from where it is expected a fix may lie and still be a target's: squared Mahalanobis distances."""

from __future__ import annotations

from fwav_companion.types import Detection

GATE = 16.0
"""With 2 degrees of freedom: a true fix lies beyond it once in 3000 times."""
ID_GATE = 4.0 * GATE
"""With the detector's own id in favour: trackers swap ids, but seldom to something that far away."""


def widest_gate(detection: Detection) -> float:
    """Beyond it nobody asks how far away this detection is, whatever the target."""
    return GATE if detection.detector_id is None else ID_GATE
