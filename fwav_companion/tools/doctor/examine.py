"""Evidence in, findings out."""

from __future__ import annotations

from itertools import chain

from fwav_companion.tools.doctor.autopilot import autopilot
from fwav_companion.tools.doctor.camera import camera
from fwav_companion.tools.doctor.clock import clock
from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding, in_order
from fwav_companion.tools.doctor.ports import ports
from fwav_companion.tools.doctor.upkeep import upkeep


def examine(evidence: Evidence) -> list[Finding]:
    """Everything that could be better, the most important first."""
    topics = (ports, autopilot, clock, camera, upkeep)
    return in_order(chain.from_iterable(topic(evidence) for topic in topics))
