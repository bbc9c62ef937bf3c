"""Landmarks: does the filter use them, can they be seen from here, are they seen, do they agree with other evidence."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from fwav_companion.config.estimation import LandmarkConfig
from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.vectors import norm
from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding
from fwav_companion.tools.doctor.finding_table import make_finding
from fwav_companion.tools.doctor.landing_findings import labels_heard
from fwav_companion.types import LandmarkState
from fwav_companion.types.flight_status import LandmarkReport, OriginReport
from fwav_companion.types.status import RunStatus

FAR_M: Final = 10_000.0
"""Distance from the origin, metres, beyond the range of a small vehicle; an error of a degree, or latitude exchanged
with longitude, is more."""
FRAMES: Final = 20
"""Frames without its label before a landmark counts as not seen."""


def landmark_findings(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    """Yield everything about the landmarks; nothing where the configuration has none, and for a relay."""
    landmarks = evidence.config.landmark
    if not landmarks or not evidence.config.localizes or evidence.files.calibration is None:
        return
    reports = {report.label: report for report in status.seen.landmarks}
    if any(report.state == LandmarkState.NOT_APPLIED for report in reports.values()):
        yield _not_applied(evidence)
        return
    for landmark in landmarks:
        yield from _place(landmark, status.origin)
        yield from _sights(evidence, status, reports.get(landmark.label, LandmarkReport(label=landmark.label)))


def _not_applied(evidence: Evidence) -> Finding:
    config = evidence.config
    moving = [target.label for target in config.target if target.motion == "moving"]
    moving += [pad.label for pad in config.pad if pad.motion == "moving"]
    return make_finding(
        "landmarks_not_applied",
        "motion" if config.tracking.filter == "kalman" else "filter",
        filter=config.tracking.filter,
        moving=", ".join(moving) or "[tracking]",
    )


def _place(landmark: LandmarkConfig, origin: OriginReport | None) -> Iterator[Finding]:
    if origin is None:
        return
    plane = TangentPlane(Geodetic.from_degrees(origin.lat, origin.lon, origin.alt_amsl))
    away_m = norm(plane.ned_from_geodetic(landmark.known.place))
    if away_m > FAR_M:
        yield make_finding(
            "landmark_far", label=landmark.label, distance_km=away_m / 1e3, lat=landmark.lat, lon=landmark.lon
        )


def _sights(evidence: Evidence, status: RunStatus, report: LandmarkReport) -> Iterator[Finding]:
    label, heard = report.label, status.seen.heard.labels.get(report.label, 0)
    labels, left_out = evidence.config.detections.labels, report.state == LandmarkState.LEFT_OUT
    if labels and label not in labels:
        yield make_finding("landmark_filtered", label=label)
    elif report.contradicts:
        case = "left_out" if left_out else "used"
        yield make_finding("landmarks_contradict", case, label=label, others=", ".join(report.contradicts))
    elif left_out:
        yield make_finding("landmark_left_out", label=label, off_m=report.off_m)
    elif heard >= FRAMES and not report.used and not report.refused:
        yield make_finding("landmark_without_sights", label=label, count=heard)
    elif status.frames >= FRAMES and not heard:
        yield make_finding("landmark_unseen", label=label, frames=status.frames, heard=labels_heard(status))
