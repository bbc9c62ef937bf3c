"""[act]: what would be commanded, what the gimbal can do, and whether the autopilot hears the followed target."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding
from fwav_companion.tools.doctor.finding_table import make_finding
from fwav_companion.types.flight_status import ActingReport
from fwav_companion.types.status import RunStatus

UNKNOWN: Final = (None, None)
LAST_BEHIND_AUTOPILOT: Final = 6
"""Largest gimbal_device_id of a gimbal whose attitude the autopilot reports, often what it commands."""


def acting_findings(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    """Yield everything about acting on a target, where [act] asks for it."""
    acting = status.acting
    if acting is None:
        return
    if acting.point == "roi":
        yield make_finding("act_roi")
    elif acting.point == "gimbal":
        yield from _gimbal(evidence, acting)
    if acting.follow_target:
        yield from _follow(evidence, status, acting)


def _gimbal(evidence: Evidence, acting: ActingReport) -> Iterator[Finding]:
    if acting.manager is None:
        yield make_finding("act_no_manager")
    else:
        pitch_deg, yaw_deg = acting.pitch_limits_deg, acting.yaw_limits_deg
        (down_deg, up_deg), (left_deg, right_deg) = pitch_deg or UNKNOWN, yaw_deg or UNKNOWN
        yield make_finding(
            "act_gimbal",
            "unknown" if None in (pitch_deg, yaw_deg) else "limits",
            "none" if acting.primary in (None, "0/0") else "program",
            manager=acting.manager,
            primary=acting.primary,
            down_deg=down_deg,
            up_deg=up_deg,
            left_deg=left_deg,
            right_deg=right_deg,
        )
    if 0 < evidence.config.camera.mount.gimbal_device_id <= LAST_BEHIND_AUTOPILOT:
        yield make_finding("act_stick_unseen")


def _follow(evidence: Evidence, status: RunStatus, acting: ActingReport) -> Iterator[Finding]:
    act = evidence.config.act
    system = 0 if act is None else act.follow_system_id
    if acting.follow_id_heard:
        yield make_finding("follow_id_heard", system=system)
    if status.autopilot is None or status.autopilot.kind != "ardupilot":
        return
    if system == 0:
        yield make_finding("follow_own_system")
        return
    followed = status.parameters.get("FOLL_SYSID")
    if followed is not None and round(followed) != system:
        yield make_finding("follow_other_system", followed=followed, system=system)
