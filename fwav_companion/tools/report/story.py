"""The flight as a report needs it: courses by target, where the vehicle was, the clock, and what was not used. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import Any

import msgspec

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.recording.lines import Line, line_unix_s
from fwav_companion.recording.truth import TruthPoint
from fwav_companion.tools.report.courses import Course, Replayed, courses
from fwav_companion.tools.report.ways import PLAIN, Way

CAUSES = ("position", "heading", "attitude", "mount", "height", "time", "pixel", "terrain")
"""Of a fix's budget, as a recording names them."""
PATH_GAP_S = 1.0
"""A second without a sighting ends a stretch of the believed path."""


class ClockPoint(msgspec.Struct, frozen=True):
    """The autopilot's clock on ours."""

    at_s: float
    sigma_s: float
    bound_s: float
    status: str


class CalibrationPoint(msgspec.Struct, frozen=True):
    """What self-calibration believed at one time."""

    at_s: float
    time_offset_s: float
    time_offset_sigma_s: float
    mount_deg: Sequence[float]
    """A rotation vector about the body's x, y, z."""
    mount_sigma_deg: Sequence[float]
    status: str
    mistake: str
    """What is grossly wrong with the mount; empty: nothing that it would know of."""


class Planted(msgspec.Struct, frozen=True):
    """What is true of the camera and was told to nobody."""

    time_offset_s: float
    mount_deg: Sequence[float]


class PictureShown(msgspec.Struct, frozen=True):
    """One frame, and what was seen in it."""

    jpeg: bytes
    size: tuple[int, int]
    frame: int
    detections: Sequence[Mapping[str, Any]]
    """As on the wire."""


class Story(msgspec.Struct, frozen=True, kw_only=True):
    """One flight."""

    title: str
    seconds: float
    version: str
    origin: Geodetic | None
    courses: list[Course]
    way: Way
    """How it was tracked."""
    path: list[list[tuple[float, float]]]
    """Of the vehicle, north and east, in stretches: true where that is known, else as it believed."""
    path_is_true: bool
    gaps_s: list[float]
    """From each used detection to the nearest attitude."""
    budget_m: dict[str, float]
    """Root mean square over the fixes, by cause."""
    clock: list[ClockPoint]
    frames: int
    detections: int
    fixes: int
    dropped: dict[str, int]
    picture: PictureShown | None
    hidden: dict[str, str]
    """What was wrong with the vehicle and was told to nobody, where it is known."""
    notes: list[str]
    moving: bool
    """Whether targets were taken to move."""
    learned: list[CalibrationPoint]
    """Of this replay, or of another one of the same recording where this did not calibrate."""
    learned_by: str
    """The name of that other one; empty: this."""
    planted: Planted | None

    @property
    def mistake(self) -> str:
        """The last gross mistake of the mount that was named; empty where none was."""
        return next((point.mistake for point in reversed(self.learned) if point.mistake), "")


def tell(
    lines: Sequence[Line],
    *,
    title: str,
    truth: Sequence[TruthPoint] = (),
    way: Way = PLAIN,
    others: Sequence[Replayed] = (),
    planted: Planted | None = None,
    true_path: Sequence[tuple[float, float]] = (),
    picture: PictureShown | None = None,
    hidden: Mapping[str, str] | None = None,
    notes: Iterable[str] = (),
) -> Story:
    """From the lines of a replay with sightings. ``others``: the same recording, tracked in other ways."""
    header = lines[0]
    summary = lines[-1] if lines[-1]["type"] == "summary" else {}
    place = next((line["origin"] for line in lines if line["type"] in ("header", "origin") and line["origin"]), None)
    origin = Geodetic.from_degrees(place["lat"], place["lon"], place["alt_amsl"]) if place else None
    plane = TangentPlane(origin) if origin else None
    begun, ended = _span([*lines, *chain.from_iterable(other.lines for other in others)], header["unix_offset_s"])
    used = [line for line in lines if line["type"] == "sighting" and line["reason"] is None]
    learned, learned_by = _learned([Replayed("", way.kind, lines), *others], begun)
    return Story(
        title=title,
        seconds=ended - begun,
        version=header["version"],
        origin=origin,
        courses=courses(lines, others, truth, plane, begun),
        way=way,
        path=[list(true_path)] if true_path else _believed_path(used),
        path_is_true=bool(true_path),
        gaps_s=[line["gap_s"] for line in used if line["gap_s"] is not None],
        budget_m=_budget([line["budget"] for line in used if line["budget"]]),
        clock=[
            ClockPoint(line["time_monotonic"] + header["unix_offset_s"] - begun, line["sigma_s"], line["bound_s"],
                       line.get("status", ""))
            for line in lines if line["type"] == "clock"
        ],
        frames=summary.get("frames", 0),
        detections=summary.get("detections", 0),
        fixes=summary.get("fixes", 0),
        dropped=dict(summary.get("dropped", {})),
        picture=picture,
        hidden=dict(hidden or {}),
        notes=list(notes),
        moving=header["config"].get("tracking", {}).get("motion") == "moving",
        learned=learned,
        learned_by=learned_by,
        planted=planted,
    )  # fmt: skip


def _span(lines: Sequence[Line], unix_offset_s: float) -> tuple[float, float]:
    """Unix times of the first and the last thing that was told."""
    told = (line_unix_s(line, unix_offset_s) for line in lines if line["type"] in ("target", "clock", "calibration"))
    times = [at_s for at_s in told if at_s is not None]
    return (min(times), max(times)) if times else (0.0, 0.0)


def _believed_path(used: Sequence[Line]) -> list[list[tuple[float, float]]]:
    """Where the vehicle saw something; in between it is not told."""
    stretches: list[list[tuple[float, float]]] = []
    last_s = float("-inf")
    for line in used:
        if line["camera_ned"] and line["time_boot"] is not None:
            if abs(line["time_boot"] - last_s) > PATH_GAP_S:
                stretches.append([])
            stretches[-1].append((line["camera_ned"][0], line["camera_ned"][1]))
            last_s = line["time_boot"]
    return stretches


def _learned(replays: Sequence[Replayed], begun: float) -> tuple[list[CalibrationPoint], str]:
    """Of the first replay that calibrated itself, and its name."""
    for replay in replays:
        told = [line for line in replay.lines if line["type"] == "calibration"]
        if told:
            points = [
                CalibrationPoint(
                    at_s=line["time_unix"] - begun,
                    time_offset_s=line["time_offset_s"],
                    time_offset_sigma_s=line["time_offset_sigma_s"],
                    mount_deg=line["mount_deg"],
                    mount_sigma_deg=line["mount_sigma_deg"],
                    status=line["status"],
                    mistake=line.get("mistake", ""),
                )
                for line in told
            ]
            return points, replay.name
    return [], ""


def _budget(budgets: Sequence[Mapping[str, float]]) -> dict[str, float]:
    if not budgets:
        return {}
    return {cause: (sum(each[cause] ** 2 for each in budgets) / len(budgets)) ** 0.5 for cause in CAUSES}
