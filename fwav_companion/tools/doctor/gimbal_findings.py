"""The gimbal that carries the camera: does it report its attitude in a form that can be used, and from which zeros."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding, Level
from fwav_companion.types.status import RunStatus

WHERE: Final = "[camera.mount]"
REFUSED_FIXES: Final[Mapping[str, str]] = {
    "gimbal_flags": "update the gimbal's firmware: its flags say that yaw counts from the vehicle and from north",
    "gimbal_setpoint": "have the gimbal send GIMBAL_DEVICE_ATTITUDE_STATUS; PX4's MOUNT_ORIENTATION is a setpoint",
    "no_gimbal": "check what the gimbal sends: its quaternion is not finite, or its stamps do not rise",
}


def gimbal_findings(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    """Yield everything about the gimbal; nothing for a camera that is fixed to the body, unless a gimbal is heard."""
    if not evidence.config.localizes or evidence.files.calibration is None:
        return
    device_id = status.telemetry.gimbal_unused
    if device_id is not None:
        yield Finding(
            "gimbal_unused",
            Level.WARNING,
            WHERE,
            problem="a gimbal is heard, and gimbal_device_id = 0: the camera counts as fixed to the body",
            fix=f"if it carries the camera, set gimbal_device_id = {device_id}; the angles then count from its axes",
        )
    gimbal = status.telemetry.gimbal
    if gimbal is None:
        return
    if gimbal.refused_as is not None:
        yield Finding(
            "gimbal_refused",
            Level.ERROR,
            WHERE,
            problem=f"every attitude of the gimbal is refused: {gimbal.refused_as}",
            fix=REFUSED_FIXES.get(gimbal.refused_as, REFUSED_FIXES["no_gimbal"]),
        )
    if gimbal.heading_off_deg is not None:
        yield Finding(
            "gimbal_heading",
            Level.WARNING,
            WHERE,
            problem=f"the gimbal's heading of the vehicle is {gimbal.heading_off_deg:+.0f} deg off the autopilot's, "
            "which is used",
            fix="calibrate the gimbal's compass, or set its yaw zero; targets are right if its encoder is",
        )
    if gimbal.levelled is None and gimbal.age_s is not None:
        yield Finding(
            "gimbal_horizon",
            Level.NOTE,
            WHERE,
            problem="no motion has shown whether the gimbal's roll and pitch count from the horizon or from the body: "
            "both are in the claim",
            fix="tilt the vehicle by some degrees for ten seconds, or set levelled = true or false",
        )
