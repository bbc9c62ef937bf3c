"""The camera: its calibration, elevation models, and the stream of its detections."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding
from fwav_companion.tools.doctor.finding_table import make_finding
from fwav_companion.types import NoRay
from fwav_companion.types.status import RunStatus
from fwav_companion.vision.task import shown_source

STALE_S: Final = 2.0
"""Longest time without a frame, seconds. The slowest cameras in use give five frames a second."""
FIRST_FRAME_S: Final = 2.0
"""Longest time from the service's start to the first frame, seconds."""


def file_findings(evidence: Evidence) -> Iterator[Finding]:
    """Yield what is wrong with the camera's files; nothing for a relay."""
    if not evidence.config.localizes:
        return
    if evidence.files.calibration_error:
        yield make_finding("calibration", error=evidence.files.calibration_error)
        return
    yield from _narrow(evidence)
    if evidence.files.elevation_error:
        yield make_finding("terrain_file", error=evidence.files.elevation_error)


def camera_findings(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    """Yield what is wrong with the stream of frames, and with the terrain at the vehicle's place."""
    if not evidence.config.localizes or evidence.files.calibration_error:
        return
    yield from _terrain(evidence, status)
    yield from _stream(evidence, status)
    yield from _readout(status)


def _readout(status: RunStatus) -> Iterator[Finding]:
    """An unknown readout is one bias through a flight: it never averages away."""
    readout = status.seen.readout
    if readout.matters:
        yield make_finding("readout_unknown", by_readout_m=readout.by_readout_m, sigma_m=readout.sigma_m)


def _narrow(evidence: Evidence) -> Iterator[Finding]:
    """Pixels beyond the valid angle are refused: the user should know before the flight."""
    calibration = evidence.files.calibration
    if calibration is None:
        return
    width, height = calibration.image_size
    edges = [(0.0, (height - 1) / 2.0), (width - 1.0, (height - 1) / 2.0)]
    if any(isinstance(calibration.lens.camera_ray_from_pixel(u, v), NoRay) for u, v in edges):
        yield make_finding("narrow_calibration", angle_deg=57.29578 * calibration.lens.max_angle)


def _terrain(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    origin = status.origin
    if evidence.files.elevation_error or evidence.config.ground.model != "terrain" or origin is None:
        return
    inside = (tile.row_column(origin.lat, origin.lon) for tile in evidence.files.elevation)
    sizes = ((tile.rows - 1, tile.columns - 1) for tile in evidence.files.elevation)
    covered = any(
        0 <= row <= last and 0 <= column <= end for (row, column), (last, end) in zip(inside, sizes, strict=True)
    )
    if not covered:
        yield make_finding("terrain_coverage", lat=origin.lat, lon=origin.lon, file=_hgt_name(origin.lat, origin.lon))


def _hgt_name(lat: float, lon: float) -> str:
    south, west = int(lat // 1), int(lon // 1)
    return f"{'N' if south >= 0 else 'S'}{abs(south):02d}{'E' if west >= 0 else 'W'}{abs(west):03d}.hgt"


def _stream(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    config, intake = evidence.config, status.intake
    camera = shown_source(config.vision) if config.vision else ""
    where = config.detections.url or camera
    if status.vision is not None and not status.vision.works:
        why = status.vision.why
        if status.vision.stopped:
            yield make_finding("vision_stopped", why=why)
        elif why or status.up_s >= FIRST_FRAME_S:
            yield make_finding("no_camera", "why" if why else "silent", camera=camera, why=why)
    elif intake.why:
        holder = evidence.board.holders.get("detections")
        case = "taken" if holder or "in use" in intake.why else "address"
        yield make_finding("detections_port", case, url=where, why=intake.why, holder=holder)
    elif not intake.came:
        if status.up_s >= FIRST_FRAME_S:
            yield make_finding("no_detections", source=where)
    elif intake.age_s is not None and intake.age_s > STALE_S:
        yield make_finding("stale_detections", age_s=intake.age_s)
