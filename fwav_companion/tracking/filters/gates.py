"""Gates on the normalised innovation squared (NIS) of a fix."""

from __future__ import annotations

from fwav_companion.types import Detection

GATE = 16.0
"""Gate on the NIS, 2 degrees of freedom: a true fix exceeds it once in 3000 times."""
ID_GATE = 4.0 * GATE
"""Gate of a fix with the detector id of the target: trackers swap ids, but seldom to something that far away."""


def widest_gate(detection: Detection) -> float:
    """The widest gate that applies to a detection, whatever the target."""
    return GATE if detection.detector_id is None else ID_GATE
