"""The camera: its calibration, elevation models, and the stream of its detections."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding, Level
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
        yield Finding(
            "calibration",
            Level.ERROR,
            "[camera] calibration",
            problem=evidence.files.calibration_error,
            fix="correct the path or the file: `fwav-companion calibrate` makes one, `init` writes the paper's camera",
        )
        return
    yield from _narrow(evidence)
    if evidence.files.elevation_error:
        yield Finding(
            "terrain_file",
            Level.ERROR,
            "[ground] terrain",
            problem=evidence.files.elevation_error,
            fix="name files that can be read",
        )


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
        yield Finding(
            "readout_unknown",
            Level.NOTE,
            "[camera] readout_s",
            problem=f"unknown, it makes {readout.by_readout_m:.1f} of the {readout.sigma_m:.1f} m of a fix (one sigma)",
            fix="set it: 0 for a global shutter, else the time from the first row to the last, by the sensor's data "
            "sheet or `check --shake`",
        )


def _narrow(evidence: Evidence) -> Iterator[Finding]:
    """Pixels beyond the valid angle are refused: the user should know before the flight."""
    calibration = evidence.files.calibration
    if calibration is None:
        return
    width, height = calibration.image_size
    edges = [(0.0, (height - 1) / 2.0), (width - 1.0, (height - 1) / 2.0)]
    if any(isinstance(calibration.lens.camera_ray_from_pixel(u, v), NoRay) for u, v in edges):
        angle_deg = 57.29578 * calibration.lens.max_angle
        yield Finding(
            "narrow_calibration",
            Level.NOTE,
            "[camera] calibration",
            problem=f"it is valid to {angle_deg:.0f} deg from the axis: detections at the image's sides are refused",
            fix="calibrate with the board at the image's sides too, if that matters",
        )


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
        yield Finding(
            "terrain_coverage",
            Level.ERROR,
            "[ground] terrain",
            problem=f"no file covers the vehicle's position {origin.lat:.4f}, {origin.lon:.4f}",
            fix=f"add the file of that place, as {_hgt_name(origin.lat, origin.lon)}",
        )


def _hgt_name(lat: float, lon: float) -> str:
    south, west = int(lat // 1), int(lon // 1)
    return f"{'N' if south >= 0 else 'S'}{abs(south):02d}{'E' if west >= 0 else 'W'}{abs(west):03d}.hgt"


def _stream(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    config, intake = evidence.config, status.intake
    camera = shown_source(config.vision) if config.vision else ""
    where = config.detections.url or camera
    if status.vision is not None and not status.vision.works:
        if status.vision.stopped:
            yield Finding(
                "vision_stopped",
                Level.ERROR,
                "[vision] detector",
                problem=f"the detector cannot work as it is configured: {status.vision.why}",
                fix="change what it names, then restart the service",
            )
        elif status.vision.why or status.up_s >= FIRST_FRAME_S:
            yield Finding(
                "no_camera",
                Level.ERROR,
                "[vision] source",
                problem=f"no pictures of {camera}: {status.vision.why or 'the camera is still silent'}",
                fix="check that the camera is connected and its name right: libcamera:0 | /dev/video0",
            )
    elif intake.why:
        yield _deaf(evidence, where, intake.why)
    elif not intake.came:
        if status.up_s >= FIRST_FRAME_S:
            yield Finding(
                "no_detections",
                Level.ERROR,
                "[detections] url",
                problem=f"no frame arrived on {where}",
                fix="start the detector; it sends one JSON object a frame there, also for frames that show nothing",
            )
    elif intake.age_s is not None and intake.age_s > STALE_S:
        yield Finding(
            "stale_detections",
            Level.ERROR,
            "[detections] url",
            problem=f"the last frame arrived {intake.age_s:.0f} s ago",
            fix="check whether the detector still runs",
        )


def _deaf(evidence: Evidence, where: str, why: str) -> Finding:
    holder = evidence.board.holders.get("detections", "")
    taken = holder or "in use" in why
    return Finding(
        "detections_port",
        Level.ERROR,
        "[detections] url",
        problem=f"{where} cannot be listened on: {why}" + (f" (in use by {holder})" if holder else ""),
        fix="end that program, or use another address on both sides"
        if taken
        else "use an address of this board, as 127.0.0.1 or 0.0.0.0, or unix:///PATH in a folder that it may write to",
    )
