"""[act]: what would be commanded, what the gimbal can do, and whether the autopilot hears the followed target."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding, Level
from fwav_companion.types.flight_status import ActingReport
from fwav_companion.types.status import RunStatus

WHERE: Final = "[act]"
LAST_BEHIND_AUTOPILOT: Final = 6
"""Largest gimbal_device_id of a gimbal whose attitude the autopilot reports, often what it commands."""


def acting_findings(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    """Yield everything about acting on a target, where [act] asks for it."""
    acting = status.acting
    if acting is None:
        return
    if acting.point == "roi":
        yield Finding(
            "act_roi",
            Level.NOTE,
            WHERE,
            problem='point = "roi": the autopilot points, and a copter without a panning mount turns its nose',
            fix='nothing, if that is wanted; else point = "gimbal"',
        )
    elif acting.point == "gimbal":
        yield from _gimbal(evidence, acting)
    if acting.follow_target:
        yield from _follow(evidence, status, acting)


def _gimbal(evidence: Evidence, acting: ActingReport) -> Iterator[Finding]:
    if acting.manager is None:
        yield Finding(
            "act_no_manager",
            Level.WARNING,
            WHERE,
            problem="no gimbal manager answers",
            fix="ArduPilot: MNT1_TYPE; PX4: MNT_MODE_IN = 4 (gimbal protocol v2); check the gimbal's link",
        )
    else:
        yield Finding(
            "act_gimbal",
            Level.NOTE,
            WHERE,
            problem=f"the gimbal of manager {acting.manager} {_reach(acting)}; controlled by {_holder(acting)}",
            fix="nothing; the service takes the control when a target is selected, and gives it back",
        )
    if 0 < evidence.config.camera.mount.gimbal_device_id <= LAST_BEHIND_AUTOPILOT:
        yield Finding(
            "act_stick_unseen",
            Level.NOTE,
            WHERE,
            problem="the autopilot reports this gimbal's attitude: where that is what it commands, a pilot's stick is "
            "not seen",
            fix="end the tracking (STOP) before the stick is used",
        )


def _reach(acting: ActingReport) -> str:
    if acting.pitch_limits_deg is None or acting.yaw_limits_deg is None:
        return "does not say how far it turns"
    (down, up), (left, right) = acting.pitch_limits_deg, acting.yaw_limits_deg
    return f"turns from {down:.0f} to {up:.0f} deg in pitch, from {left:.0f} to {right:.0f} in yaw, by its own word"


def _holder(acting: ActingReport) -> str:
    return "no program" if acting.primary in (None, "0/0") else str(acting.primary)


def _follow(evidence: Evidence, status: RunStatus, acting: ActingReport) -> Iterator[Finding]:
    act = evidence.config.act
    system = 0 if act is None else act.follow_system_id
    if acting.follow_id_heard:
        yield Finding(
            "follow_id_heard",
            Level.ERROR,
            WHERE,
            problem=f"another sender is heard with follow_system_id = {system}: FOLLOW_TARGET is not sent",
            fix="set follow_system_id to an unused id",
        )
    if status.autopilot is None or status.autopilot.kind != "ardupilot":
        return
    if system == 0:
        yield Finding(
            "follow_own_system",
            Level.WARNING,
            WHERE,
            problem="ArduPilot ignores FOLLOW_TARGET of its own system, and follow_system_id = 0",
            fix="set follow_system_id to an unused id, and FOLL_SYSID to the same",
        )
        return
    followed = status.parameters.get("FOLL_SYSID")
    if followed is not None and round(followed) != system:
        yield Finding(
            "follow_other_system",
            Level.WARNING,
            WHERE,
            problem=f"FOLL_SYSID = {followed:.0f}, and FOLLOW_TARGET comes from follow_system_id = {system}",
            fix=f"set FOLL_SYSID to {system}; 0 means no system from ArduPilot 4.8 on",
        )
