"""The camera's mount: is it in degrees, does the camera see ground, do the fixes of one target agree; the gimbal."""

from __future__ import annotations

from collections.abc import Iterator
from math import asin, degrees, hypot, pi
from typing import Final

from fwav_companion.geometry.vectors import Vector3
from fwav_companion.tools.doctor.detection_findings import FEW, MOST, SHARE, SKYWARD, judged_detections
from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding
from fwav_companion.tools.doctor.finding_table import make_finding
from fwav_companion.types import Reason
from fwav_companion.types.status import RunStatus

ANGLES: Final = ("roll_deg", "pitch_deg", "yaw_deg")
RADIAN_STEP_DEG, RADIAN_TOLERANCE_DEG = 15.0, 0.05
"""Step and tolerance of angles typed in radians: mostly a multiple of 15 deg, with four digits."""
LONGEST_LEVER_M: Final = 5.0
"""Longest plausible distance of the camera from the vehicle's reference point, metres; 5 mm typed as metres is as
long."""
STEEP_DEG: Final = 20.0
"""Angle below the horizon of the flattest ray of a picture from which no ray is too flat by itself: a fix is refused as
too shallow there only where its direction is wrong by degrees."""


def mount_findings(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    """Yield everything about the mount; nothing for a relay."""
    if not evidence.config.localizes or evidence.files.calibration is None:
        return
    yield from _radians(evidence)
    yield from _lever(evidence)
    yield from _above_horizon(evidence, status)
    yield from _disagreeing(evidence, status)


def _radians(evidence: Evidence) -> Iterator[Finding]:
    mount = evidence.config.camera.mount
    if not _in_radians(mount.angles):
        return
    named = {name: angle for name, angle in zip(ANGLES, mount.angles, strict=True) if angle}
    elevation_deg = _level_elevation_deg(evidence)
    yield make_finding(
        "mount_in_radians",
        angles=", ".join(f"{name} = {angle:g}" for name, angle in named.items()),
        degrees=", ".join(f"{name} = {degrees(angle):.1f}" for name, angle in named.items()),
        elevation_deg=abs(elevation_deg),
        side=_side(elevation_deg),
    )


def _lever(evidence: Evidence) -> Iterator[Finding]:
    """Yield a camera position in mm or cm: it moves every target by metres, and no measurement contradicts it."""
    position_m = evidence.config.camera.mount.position_m
    length_m = hypot(*position_m)
    if length_m >= LONGEST_LEVER_M:
        yield make_finding(
            "lever_arm_long",
            position=_listed(position_m),
            length_m=length_m,
            by_mm=_listed(position_m, 1e3),
            by_cm=_listed(position_m, 1e2),
        )


def _listed(position: Vector3, divisor: float = 1.0) -> str:
    return f"[{', '.join(f'{value / divisor:g}' for value in position)}]"


def _in_radians(angles: tuple[float, float, float]) -> bool:
    """Return whether all angles are within a turn in radians, and one is a multiple of 15 deg in radians."""
    if any(abs(angle) > 2.0 * pi for angle in angles):
        return False
    return any(
        abs(degrees(angle) - RADIAN_STEP_DEG * round(degrees(angle) / RADIAN_STEP_DEG)) < RADIAN_TOLERANCE_DEG
        for angle in angles
        if angle
    )


def _above_horizon(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    mount, elevation_deg = evidence.config.camera.mount, status.seen.axis_elevation_deg
    lost, judged = status.refused(*SKYWARD), judged_detections(status)
    uncertain = status.refused(Reason.TOO_SHALLOW)
    if _looks_steeply_down(evidence, elevation_deg):
        lost -= uncertain
        if uncertain >= FEW and uncertain > SHARE * judged:
            yield make_finding("direction_uncertain", count=uncertain, judged=judged)
    if lost >= FEW and lost > SHARE * judged:
        sight, mostly = "detections", lost > MOST * judged
    elif not judged and elevation_deg is not None and _sees_no_ground(evidence, elevation_deg):
        sight, mostly = "image", _sees_no_ground(evidence, _level_elevation_deg(evidence))
    else:
        return
    looks_deg = _level_elevation_deg(evidence) if elevation_deg is None else elevation_deg
    yield make_finding(
        "above_horizon",
        sight,
        "mostly" if mostly else "partly",
        lost=lost,
        judged=judged,
        angles=", ".join(f"{angle:g}" for angle in mount.angles),
        elevation_deg=abs(looks_deg),
        side=_side(looks_deg),
    )


def _side(elevation_deg: float) -> str:
    """Return on which side of the horizon the camera looks."""
    return "above" if elevation_deg > 0.0 else "below"


def _level_elevation_deg(evidence: Evidence) -> float:
    """Return the elevation of the optical axis while the vehicle is level."""
    return -degrees(asin(max(-1.0, min(1.0, evidence.config.camera.mount.body_from_camera[2][2]))))


def _sees_no_ground(evidence: Evidence, elevation_deg: float) -> bool:
    calibration = evidence.files.calibration
    return calibration is not None and elevation_deg > degrees(calibration.lens.max_angle)


def _looks_steeply_down(evidence: Evidence, elevation_deg: float | None) -> bool:
    calibration = evidence.files.calibration
    if calibration is None or elevation_deg is None:
        return False
    return elevation_deg + degrees(calibration.lens.max_angle) < -STEEP_DEG


def _disagreeing(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    agreement, mount = status.seen.agreement, evidence.config.camera.mount
    turn_deg = agreement.turn_deg
    moving = evidence.config.tracking.motion == "moving"
    if not agreement.disagrees or (moving and turn_deg is None):
        return
    target = f'"{agreement.label}"' if agreement.label else "one target"
    yaw_deg = None if turn_deg is None else (mount.yaw_deg + turn_deg + 180.0) % 360.0 - 180.0
    case = "no_turn" if turn_deg is None else "turn"
    yield make_finding("fixes_disagree", case, target=target, apart_m=agreement.apart_m, yaw_deg=yaw_deg)


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
