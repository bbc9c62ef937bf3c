"""SHELL: draws a set of photographs, detects the tags in them, locates them, and compares with the truth."""

from __future__ import annotations

import json
import subprocess
import sys
from math import hypot
from pathlib import Path
from typing import Any

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.ellipses import circle_radius
from fwav_companion.on_disk import made_folder, whole
from fwav_companion.tools.locate.answers import PlaceAnswer, PlaceAnswers, answer_lines
from fwav_companion.tools.locate.detections import detected_clicks
from fwav_companion.tools.locate.exports import exported
from fwav_companion.tools.locate.photographs import CameraOptions, read_photographs
from fwav_companion.tools.locate.session import LocateOptions, LocateSession
from fwav_companion.vision.detectors import make_detector
from fwav_companion.vision.task import VisionTask

CERTAIN = 0.999
"""Share of the claim that an error has to stay within."""
DETECTION_SIGMA_PX = 0.5
"""One sigma of a tag's centre by its corners, each axis, pixels."""
PLACES, TRUTH = "places.kml", "truth.json"
DRAWING_S = 300.0
"""Longest time for drawing the pictures, seconds."""


class PhotographScore(msgspec.Struct, frozen=True, kw_only=True):
    """What became of one tag."""

    tag_id: int
    answer: PlaceAnswer | None
    error_m: float | None
    trouble: str = ""

    def as_json(self) -> dict[str, Any]:
        """The fields of `demo --json`."""
        claimed = None if self.answer is None else self.answer.radius95_m
        return {
            "id": self.tag_id,
            "found": self.answer is not None,
            "error_m": self.error_m,
            "claimed95_m": claimed,
        }

    def lines(self) -> list[str]:
        """The result for people."""
        if self.answer is None:
            return [f"tag {self.tag_id}: not found"]
        return [*answer_lines(self.answer)[:4], f"  in truth {self.error_m:.2f} m from there"]


def draw_photographs(out: Path, seed: int) -> None:
    """Let the mock, in a process of its own, write pictures and truth.json. InputFileError where it cannot."""
    command = [sys.executable, "-m", "sitl_mock.photograph_set", str(made_folder(out)), str(seed)]
    try:
        subprocess.run(command, check=True, capture_output=True, timeout=DRAWING_S)  # noqa: S603  # our own words
    except (OSError, subprocess.SubprocessError) as error:
        raise InputFileError(f"{out}: the pictures were not drawn: {str(error)[:100]}") from None


def locate_photographs(out: Path) -> list[PhotographScore]:
    """The scores of all tags in the drawn pictures; the places are written beside them."""
    truth = json.loads((out / TRUTH).read_text(encoding="utf-8"))
    photographs = read_photographs([out / name for name in truth["pictures"]], CameraOptions())
    detector = make_detector(VisionTask())
    clicks = [click for photograph in photographs for click in detected_clicks(photograph, detector)]
    answers = LocateSession(photographs, LocateOptions()).located(clicks, DETECTION_SIGMA_PX) if clicks else None
    if isinstance(answers, PlaceAnswers):
        with whole(out / PLACES) as file:
            file.write(exported(answers, Path(PLACES)))
    found = {each.label: each for each in answers.targets} if isinstance(answers, PlaceAnswers) else {}
    return [_score(tag["id"], (tag["lat"], tag["lon"]), found) for tag in truth["tags"]]


def _score(tag_id: int, place: tuple[float, float], found: dict[str, PlaceAnswer]) -> PhotographScore:
    answer = next((each for label, each in found.items() if label.rpartition(":")[2] == str(tag_id)), None)
    if answer is None:
        return PhotographScore(tag_id=tag_id, answer=None, error_m=None, trouble=f"tag {tag_id} was not found")
    plane = TangentPlane(Geodetic.from_degrees(*place, 0.0))
    north, east, _ = plane.ned_from_geodetic(Geodetic.from_degrees(answer.lat, answer.lon, 0.0))
    error, limit = hypot(north, east), circle_radius(answer.cov, CERTAIN)
    trouble = "" if error <= limit else f"tag {tag_id} is {error:.2f} m off, claimed {limit:.2f} m (99.9 %)"
    return PhotographScore(tag_id=tag_id, answer=answer, error_m=error, trouble=trouble)
