"""The gimbal that carries the camera: does it report its attitude in a form that can be used, and from which zeros."""

from __future__ import annotations

from collections.abc import Iterator

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding
from fwav_companion.tools.doctor.finding_table import make_finding
from fwav_companion.types.status import RunStatus


def gimbal_findings(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    """Yield everything about the gimbal; nothing for a camera that is fixed to the body, unless a gimbal is heard."""
    if not evidence.config.localizes or evidence.files.calibration is None:
        return
    device_id = status.telemetry.gimbal_unused
    if device_id is not None:
        yield make_finding("gimbal_unused", device_id=device_id)
    gimbal = status.telemetry.gimbal
    if gimbal is None:
        return
    if gimbal.refused_as is not None:
        yield make_finding("gimbal_refused", gimbal.refused_as, reason=gimbal.refused_as)
    if gimbal.heading_off_deg is not None:
        yield make_finding("gimbal_heading", off_deg=gimbal.heading_off_deg)
    if gimbal.levelled is None and gimbal.age_s is not None:
        yield make_finding("gimbal_horizon")
