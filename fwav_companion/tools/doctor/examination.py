"""Joins the topics: evidence in, findings with their consequences out."""

from __future__ import annotations

from collections.abc import Iterator

from fwav_companion.tools.doctor.acting_findings import acting_findings
from fwav_companion.tools.doctor.autopilot_findings import autopilot_findings, measured_attitude_hz
from fwav_companion.tools.doctor.board_findings import board_findings, service_findings
from fwav_companion.tools.doctor.camera_findings import camera_findings, file_findings
from fwav_companion.tools.doctor.causes import nested
from fwav_companion.tools.doctor.detection_findings import detection_findings
from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding
from fwav_companion.tools.doctor.finding_table import make_finding
from fwav_companion.tools.doctor.landing_findings import landing_findings
from fwav_companion.tools.doctor.landmark_findings import landmark_findings
from fwav_companion.tools.doctor.link_findings import link_findings, port_findings
from fwav_companion.tools.doctor.model_findings import model_findings
from fwav_companion.tools.doctor.mount_findings import gimbal_findings, mount_findings
from fwav_companion.tools.doctor.run_status import ADOPTION_S, MEASURED_S
from fwav_companion.types.network_status import REQUESTS
from fwav_companion.types.status import RunStatus

FROM_FILES = (port_findings, file_findings, model_findings, board_findings)
FROM_STATUS = (
    link_findings,
    autopilot_findings,
    camera_findings,
    detection_findings,
    mount_findings,
    gimbal_findings,
    landmark_findings,
    landing_findings,
    acting_findings,
    service_findings,
)


def examine(evidence: Evidence, *, elsewhere: bool = False) -> list[Finding]:
    """Return the root findings, the worst first, each with what follows from it.

    ``elsewhere``: the service runs on another machine, so that this one's ports, disks and files say nothing of it.
    """
    findings = [] if elsewhere else [finding for topic in FROM_FILES for finding in topic(evidence)]
    if evidence.status is not None:
        findings += [finding for topic in FROM_STATUS for finding in topic(evidence, evidence.status)]
        findings += _not_judged(evidence.status)
    return nested(findings, evidence)


def _not_judged(status: RunStatus) -> Iterator[Finding]:
    """Yield a note on the topics for which the time of listening was too short."""
    missing = list(_unmeasured(status))
    if missing:
        yield make_finding("too_short", up_s=status.up_s, topics=", ".join(missing))


def _unmeasured(status: RunStatus) -> Iterator[str]:
    if status.autopilot is None:
        if status.up_s < ADOPTION_S:
            yield "the autopilot"
        return
    if status.autopilot_lost or status.up_s == float("inf"):
        return
    if measured_attitude_hz(status) is None:
        yield "the rate of attitudes"
    if max(status.timesync.exchanges, status.timesync.requests) < REQUESTS:
        yield "the clock"
    if status.origin is None and status.adopted_s < MEASURED_S:
        yield "the position"
