"""The camera's side: calibration, the stream of detections, and why they are not used; elevation models."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from fwav_companion.doctor.evidence import Evidence
from fwav_companion.doctor.finding import Finding, Level
from fwav_companion.nouns import NoRay, Reason

STALE_S: Final = 2.0
"""Without a frame. The slowest cameras here give five a second."""
SHARE: Final = 0.05
"""Of what came: a reason that costs less is a flight's daily bread."""
FEW: Final = 5
"""Frames or detections: fewer refusals are no pattern."""

FRAME_REASONS: Final[Mapping[Reason, tuple[str, Level, str, str]]] = {
    Reason.MALFORMED: (
        "malformed", Level.STOPS, "are no JSON of the documented form",
        "one JSON object a datagram, with detections: []",
    ),
    Reason.NO_TIME: (
        "no_time", Level.STOPS, "do not tell their time once",
        "exactly one of time_unix, time_monotonic, time_boot: when the picture was taken",
    ),
    Reason.WRONG_UNITS: (
        "wrong_units", Level.STOPS, "have stamps in other units than seconds",
        "divide: nanoseconds by 1e9 (libcamera's SensorTimestamp), microseconds by 1e6",
    ),
    Reason.NOT_FINITE: ("not_finite", Level.STOPS, "hold NaN or infinity", "send only finite numbers"),
    Reason.WRONG_SIZE: (
        "wrong_size", Level.STOPS, "are of another shape than the calibration",
        "calibrate at the shape (width : height) that the detector sees, or tell the right size",
    ),
    Reason.FROM_THE_FUTURE: (
        "from_the_future", Level.STOPS, "were captured after they arrived",
        "stamp with this board's own clock; the detector runs on another computer? then time_boot or NTP",
    ),
    Reason.ACROSS_CLOCK_STEP: (
        "across_clock_step", Level.HARMS, "were stamped across a step of the wall clock",
        "stamp with time_monotonic: it is never stepped",
    ),
    Reason.TOO_LATE: (
        "too_late", Level.STOPS, "came more than 0.5 s after their capture",
        "a faster detector or a smaller image; is the stamp that of the capture?",
    ),
    Reason.STALE_ATTITUDE: (
        "stale_attitude", Level.HARMS, "had no attitude near their capture", "see what is said of rates and loss"
    ),
    Reason.OUTSIDE_IMAGE: (
        "outside_image", Level.HARMS, "lie outside the image", "u and v are pixels of the picture whose size is told"
    ),
    Reason.OUTSIDE_LENS: (
        "outside_lens", Level.HARMS, "lie beyond the angle for which the lens is calibrated",
        "calibrate with the board in the image's corners too, or raise max_angle_deg where the fit is known to hold",
    ),
    Reason.LOW_SCORE: ("low_score", Level.MINDS, "score below [detections] min_score", "is min_score as you want it?"),
    Reason.OTHER_LABEL: (
        "other_label", Level.MINDS, "have labels that are not among [detections] labels", "are labels as you want them?"
    ),
    Reason.BEYOND_TERRAIN: (
        "beyond_terrain", Level.HARMS, "look beyond the elevation model",
        "add the neighbouring files to [ground] terrain",
    ),
    Reason.TERRAIN_UNFIT: (
        "terrain_unfit", Level.STOPS, "meet an elevation model that disagrees with the take-off height",
        "[ground] terrain_datum: what the files' heights are counted from",
    ),
    Reason.NO_RANGE: (
        "no_range", Level.HARMS, "had no rangefinder reading at their capture",
        "see that DISTANCE_SENSOR comes, and that it looks down",
    ),
    Reason.ABOVE_HORIZON: (
        "above_horizon", Level.HARMS, "look above the horizon",
        "is [camera.mount] right? pitch_deg = -90 looks straight down, image top to the nose",
    ),
}  # fmt: skip


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
        yield from _refusals(evidence)


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
        yield Finding(
            "detections_port", Level.STOPS, "[detections] url",
            f"{where} cannot be listened on: {why}" + (f" (taken by {holder})" if holder else ""),
            "end that program, or use another address on both sides",
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


def _refusals(evidence: Evidence) -> Iterator[Finding]:
    came = max(evidence.number("intake", "came"), evidence.number("frames"), evidence.number("detections"))
    for reason, (code, level, what, do) in FRAME_REASONS.items():
        count = evidence.number("dropped", reason.value)
        if count >= FEW and count > SHARE * came:
            share = 100.0 * count / came if came else 100.0
            worst = level if share > 50.0 or level is Level.MINDS else Level.HARMS
            yield Finding(code, worst, "detections", f"{count:.0f} ({share:.0f} %) {what}", do)
