"""LANDING_TARGET: does the autopilot use it, does it turn or move what this service sends, is the target ever seen.

ArduPilot's AC_PrecLand assumes a camera's line of sight: it turns the vector by PLND_YAW_ALIGN and PLND_ORIENT, adds
PLND_CAM_POS in the attitude of the measurement, subtracts its horizontal part in the newest attitude, and adds
PLND_LAND_OFS. This service sends the vector from the vehicle to the target in body FRD: no rotation remains.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import fmod, hypot
from typing import Final

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding
from fwav_companion.tools.doctor.finding_table import make_finding
from fwav_companion.tools.doctor.landing_limits import landing_limit_findings
from fwav_companion.types.flight_status import LandingReport
from fwav_companion.types.status import RunStatus

MAVLINK_TYPE: Final = 1
"""PLND_TYPE: a companion computer that sends LANDING_TARGET."""
ROTATION_DOWN: Final = 25
"""PLND_ORIENT, ROTATION_PITCH_270: with this value AC_PrecLand does not turn the vector; the default."""
FULL_TURN_CDEG: Final = 36_000.0
SMALL_M: Final = 0.005
NO_TARGET: Final = "no_target"
"""Reason of an attempt without a target, which is usual before a landing."""
LATE_S: Final = 0.5
"""Age of a stamp at the arrival of its frame from which it is reported: without a landing it would be refused."""
LEAST_WITHHELD: Final = 5
"""Withheld messages from which they are reported: a second without frames has five."""
FRAMES: Final = 20
"""Frames without the landing label before its absence is reported."""


def landing_findings(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    """Yield everything about LANDING_TARGET, where it is switched on."""
    if not evidence.config.publish.landing_target:
        return
    if status.autopilot is not None and status.autopilot.kind == "ardupilot":
        yield from _disabled(status.parameters)
        yield from _turned(status.parameters)
        yield from _moved(status.parameters)
    yield from landing_limit_findings(evidence, status)
    yield from _label(evidence, status)
    yield from _late(status)
    yield from _withheld(evidence, status.publishing.landing)


def _late(status: RunStatus) -> Iterator[Finding]:
    """Report frames that are used for a landing although they come late: their stamps may be wrong instead."""
    ages_s = status.seen.heard.stamp_ages_s
    if ages_s and ages_s[-1] > LATE_S:
        yield make_finding("landing_camera_late", age_s=ages_s[-1])


def _withheld(evidence: Evidence, landing: LandingReport) -> Iterator[Finding]:
    """Report the counts of each reason for which the messages of a known target were withheld."""
    counts = {reason: count for reason, count in landing.withheld.items() if reason != NO_TARGET and count}
    withheld = sum(counts.values())
    if withheld < LEAST_WITHHELD:
        return
    ordered = sorted(counts, key=lambda reason: (-counts[reason], reason))
    yield make_finding(
        "landing_withheld",
        ordered[0],
        withheld=withheld,
        sent=landing.sent,
        counts=", ".join(f"{reason} {counts[reason]}" for reason in ordered),
        sigma_m=landing.sigma_m,
        limit_m=evidence.config.publish.landing_max_sigma_m,
    )


def _disabled(parameters: Mapping[str, float]) -> Iterator[Finding]:
    enabled, kind = parameters.get("PLND_ENABLED"), parameters.get("PLND_TYPE", MAVLINK_TYPE)
    if enabled == 0:
        yield make_finding("landing_disabled", "off")
    elif kind != MAVLINK_TYPE:
        yield make_finding("landing_disabled", "other_type", kind=kind)


def _turned(parameters: Mapping[str, float]) -> Iterator[Finding]:
    yaw_cdeg, orient = parameters.get("PLND_YAW_ALIGN", 0.0), parameters.get("PLND_ORIENT", ROTATION_DOWN)
    turns = []
    if fmod(yaw_cdeg, FULL_TURN_CDEG):
        turns.append(f"PLND_YAW_ALIGN = {yaw_cdeg:.0f} (by {yaw_cdeg / 100.0:.0f} deg)")
    if orient != ROTATION_DOWN:
        turns.append(f"PLND_ORIENT = {orient:.0f}")
    if turns:
        yield make_finding("landing_turned", turns=", ".join(turns))


def _moved(parameters: Mapping[str, float]) -> Iterator[Finding]:
    x_m, y_m, z_m = (parameters.get(f"PLND_CAM_POS_{axis}", 0.0) for axis in "XYZ")
    if max(abs(x_m), abs(y_m), abs(z_m)) > SMALL_M:
        yield make_finding("landing_camera_offset", x_m=x_m, y_m=y_m, z_m=z_m, length_m=hypot(x_m, y_m, z_m))
    forward_m, right_m = (parameters.get(f"PLND_LAND_OFS_{axis}", 0.0) / 100.0 for axis in "XY")
    if hypot(forward_m, right_m) > SMALL_M:
        yield make_finding(
            "landing_offset",
            x_cm=100.0 * forward_m,
            y_cm=100.0 * right_m,
            offset=_aside(forward_m, right_m),
            opposite=_aside(-forward_m, -right_m),
        )


def _aside(forward_m: float, right_m: float) -> str:
    """Return a horizontal offset in words: "0.10 m ahead of and 0.05 m left of"."""
    parts = []
    if abs(forward_m) > SMALL_M:
        parts.append(f"{abs(forward_m):.2f} m {'ahead of' if forward_m > 0.0 else 'behind'}")
    if abs(right_m) > SMALL_M:
        parts.append(f"{abs(right_m):.2f} m {'right of' if right_m > 0.0 else 'left of'}")
    return " and ".join(parts)


def _label(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    wanted, taken, heard = evidence.config.publish.landing_label, evidence.config.detections.labels, status.seen.heard
    if taken and wanted not in taken:
        yield make_finding("landing_label", "filtered", label=wanted)
    elif status.frames >= FRAMES and heard.labels.keys().isdisjoint(_names(evidence)):
        case = "others" if heard.labels else "none"
        yield make_finding("landing_label", case, label=wanted, heard=labels_heard(status))
    else:
        yield from _flat(evidence)


def _flat(evidence: Evidence) -> Iterator[Finding]:
    """Report a landing label of which nothing is configured: it is taken to lie flat on the ground."""
    config, wanted = evidence.config, evidence.config.publish.landing_label
    if wanted in {*(pad.label for pad in config.pad), *(target.label for target in config.target)}:
        return
    yield make_finding("landing_flat", label=wanted)


def _names(evidence: Evidence) -> frozenset[str]:
    """Labels of the detections that are of the landing target: its own, and those of its pad's tags."""
    wanted = evidence.config.publish.landing_label
    tags = (tag.label for pad in evidence.config.pad if pad.label == wanted for tag in pad.tags)
    return frozenset({wanted, *tags})


def labels_heard(status: RunStatus) -> str:
    """Return the labels of all detections so far, as "pad" (12), "person" (3)."""
    labels = sorted(status.seen.heard.labels.items(), key=lambda item: -item[1])
    return ", ".join(f'"{label}" ({count})' for label, count in labels) or "no detection"
