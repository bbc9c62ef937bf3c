"""Landmarks: does the filter use them, can they be seen from here, are they seen, do they agree with other evidence."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from fwav_companion.config.estimation import LandmarkConfig
from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.vectors import norm
from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding, Level
from fwav_companion.tools.doctor.landing_findings import labels_heard
from fwav_companion.types import LandmarkState
from fwav_companion.types.flight_status import LandmarkReport, OriginReport
from fwav_companion.types.status import RunStatus

WHERE: Final = "[[landmark]]"
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
    cause = f'[tracking] filter = "{config.tracking.filter}"'
    if config.tracking.filter == "kalman":
        moving = [thing.label for thing in (*config.target, *config.pad) if thing.motion == "moving"]
        cause = f'motion = "moving" of {", ".join(moving) or "[tracking]"}'
    return Finding(
        "landmarks_not_applied",
        Level.WARNING,
        WHERE,
        problem=f"landmarks are not used with {cause}",
        fix='set [tracking] filter = "kalman" and motion = "static" for all targets, or remove [[landmark]]',
    )


def _contradiction(where: str, report: LandmarkReport) -> Finding:
    others = ", ".join(report.contradicts)
    left_out = report.state == LandmarkState.LEFT_OUT
    return Finding(
        "landmarks_contradict",
        Level.WARNING,
        where,
        problem=f"it contradicts {others}, and the flight does not show which is wrong: "
        + ("all of them are left out" if left_out else "they are used, with wider claims"),
        fix="check lat, lon and alt_amsl of each, and that each label is seen at one place alone",
    )


def _place(landmark: LandmarkConfig, origin: OriginReport | None) -> Iterator[Finding]:
    if origin is None:
        return
    plane = TangentPlane(Geodetic.from_degrees(origin.lat, origin.lon, origin.alt_amsl))
    away_m = norm(plane.ned_from_geodetic(landmark.known.place))
    if away_m > FAR_M:
        yield Finding(
            "landmark_far",
            Level.WARNING,
            f'{WHERE} "{landmark.label}"',
            problem=f"it is {away_m / 1e3:.0f} km away: the camera never sees it",
            fix=f"check lat = {landmark.lat:g}, lon = {landmark.lon:g}: degrees, north and east positive",
        )


def _sights(evidence: Evidence, status: RunStatus, report: LandmarkReport) -> Iterator[Finding]:
    where, heard = f'{WHERE} "{report.label}"', status.seen.heard.labels.get(report.label, 0)
    labels = evidence.config.detections.labels
    if labels and report.label not in labels:
        yield Finding(
            "landmark_filtered",
            Level.WARNING,
            where,
            problem="[detections] labels does not have its label: its detections are refused",
            fix=f'add "{report.label}" to [detections] labels, or set labels = [] for all',
        )
    elif report.contradicts:
        yield _contradiction(where, report)
    elif report.state == LandmarkState.LEFT_OUT:
        yield Finding(
            "landmark_left_out",
            Level.WARNING,
            where,
            problem=f"it appears {report.off_m:.1f} m from its place, more than its claim allows: it is left out",
            fix="check lat, lon and alt_amsl (above sea level, not above the ellipsoid), and that this label is seen "
            "at this place alone; a larger sigma_m where the survey is no better",
        )
    elif heard >= FRAMES and not report.used and not report.refused:
        yield Finding(
            "landmark_without_sights",
            Level.WARNING,
            where,
            problem=f"{heard} detections have its label, and not one could be used",
            fix="check alt_amsl: it must be below the camera; a landmark needs the vehicle's global position",
        )
    elif status.frames >= FRAMES and not heard:
        yield Finding(
            "landmark_unseen",
            Level.NOTE,
            where,
            problem=f"not seen in {status.frames} frames; labels heard: {labels_heard(status)}",
            fix="fly over it; the label must be the detector's own",
        )
