"""The camera's side: calibration, elevation models, the stream of detections."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding, Level
from fwav_companion.tools.doctor.refusals import refusals
from fwav_companion.types import NoRay

STALE_S: Final = 2.0
"""Without a frame. The slowest cameras here give five a second."""


def camera(evidence: Evidence) -> Iterator[Finding]:
    """All of it; nothing for a relay alone."""
    if not evidence.config.localizes:
        return
    if evidence.files.calibration_error:
        yield Finding(
            "calibration", Level.STOPS, "[camera] calibration", evidence.files.calibration_error,
            "`fwav-companion calibrate` makes one; `init` writes the paper's camera as an example",
        )  # fmt: skip
        return
    yield from _corners(evidence)
    yield from _terrain(evidence)
    if evidence.status:
        yield from _stream(evidence)
        yield from refusals(evidence)


def _corners(evidence: Evidence) -> Iterator[Finding]:
    """Corners beyond the valid angle are lost: the user should know before the flight."""
    calibration = evidence.files.calibration
    if calibration is None:
        return
    width, height = calibration.image_size
    edges = [(0.0, (height - 1) / 2.0), (width - 1.0, (height - 1) / 2.0)]
    if any(isinstance(calibration.lens.camera_ray_from_pixel(u, v), NoRay) for u, v in edges):
        angle_deg = 57.29578 * calibration.lens.max_angle
        yield Finding(
            "narrow_calibration", Level.MINDS, "[camera] calibration",
            f"it holds to {angle_deg:.0f} deg from the axis: what is seen at the image's sides is refused",
            "calibrate with the board out to the sides, if that matters",
        )  # fmt: skip


def _terrain(evidence: Evidence) -> Iterator[Finding]:
    if evidence.files.elevation_error:
        yield Finding(
            "terrain_file",
            Level.STOPS,
            "[ground] terrain",
            evidence.files.elevation_error,
            "give files that can be read",
        )
        return
    origin = evidence.ask("origin")
    if evidence.config.ground.model != "terrain" or not isinstance(origin, Mapping):
        return
    inside = (tile.row_column(origin["lat"], origin["lon"]) for tile in evidence.files.elevation)
    sizes = ((tile.rows - 1, tile.columns - 1) for tile in evidence.files.elevation)
    covered = any(
        0 <= row <= last and 0 <= column <= end for (row, column), (last, end) in zip(inside, sizes, strict=True)
    )
    if not covered:
        yield Finding(
            "terrain_coverage", Level.STOPS, "[ground] terrain",
            f"the vehicle is at {origin['lat']:.4f}, {origin['lon']:.4f}, where none of the files reaches",
            f"add the file of that place, as {_hgt_name(origin['lat'], origin['lon'])}",
        )  # fmt: skip


def _hgt_name(lat: float, lon: float) -> str:
    south, west = int(lat // 1), int(lon // 1)
    return f"{'N' if south >= 0 else 'S'}{abs(south):02d}{'E' if west >= 0 else 'W'}{abs(west):03d}.hgt"


def _stream(evidence: Evidence) -> Iterator[Finding]:
    where = evidence.config.detections.url or (evidence.config.vision.source if evidence.config.vision else "")
    vision = evidence.ask("vision")
    if isinstance(vision, Mapping) and not vision.get("works"):
        yield Finding(
            "no_camera", Level.STOPS, "[vision] source", f"no pictures of {where}: {vision.get('why') or 'not yet'}",
            "see that the camera is connected and named right: libcamera:0 | /dev/video0",
        )  # fmt: skip
        return
    why = evidence.ask("intake", "why")
    if why:
        holder = evidence.board.holders.get("detections", "")
        taken = holder or "in use" in str(why)
        yield Finding(
            "detections_port", Level.STOPS, "[detections] url",
            f"{where} cannot be listened on: {why}" + (f" (taken by {holder})" if holder else ""),
            "end that program, or use another address on both sides" if taken else
            "use an address of this board, as 127.0.0.1 or 0.0.0.0, or unix:///PATH in a folder that it may write to",
        )  # fmt: skip
        return
    age_s = evidence.ask("intake", "age_s")
    if not evidence.number("intake", "came"):
        yield Finding(
            "no_detections", Level.STOPS, "[detections] url", f"no frame came by {where}",
            "start the detector; it sends one JSON object a frame there, also for frames that show nothing",
        )  # fmt: skip
    elif isinstance(age_s, int | float) and age_s > STALE_S:
        yield Finding(
            "stale_detections", Level.STOPS, "[detections] url", f"the last frame came {age_s:.0f} s ago",
            "see what became of the detector",
        )  # fmt: skip
