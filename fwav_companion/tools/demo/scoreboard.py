"""What was found against what is true. Pure: lines of the recording in, one judgement a target out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from math import hypot
from typing import Any

import msgspec

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.ellipses import circle_radius

DUE_FRAMES = 10
"""A tag that was in so many delivered pictures, whole and readable, has to be found."""
BELIEVED = ("confirmed", "coasting")


class Score(msgspec.Struct, frozen=True):
    """One target."""

    label: str
    state: str
    """Of its newest line; "" before there was one."""
    north: float
    east: float
    found: bool
    """It was confirmed at some time."""
    error_m: float | None
    claimed95_m: float | None
    claimed999_m: float | None
    usable_frames: int

    @property
    def id(self) -> int:
        """The tag's number."""
        return int(self.label.rpartition(":")[2])

    @property
    def due(self) -> bool:
        """It could have been found."""
        return self.usable_frames >= DUE_FRAMES

    @property
    def trouble(self) -> str | None:
        """What is wrong with this answer."""
        if not self.found:
            return f"tag {self.id} was readable in {self.usable_frames} pictures and not found" if self.due else None
        if self.error_m is not None and self.claimed999_m is not None and self.error_m > self.claimed999_m:
            claim = f"claimed within {self.claimed999_m:.2f} m (99.9 %)"
            return f"tag {self.id} is off by {self.error_m:.2f} m, {claim}"
        return None


class Scoreboard:
    """Fed with the service's lines and the mock's truth as they are written."""

    def __init__(self) -> None:
        self._truth: dict[str, Geodetic] = {}
        self._plane: TangentPlane | None = None
        self._newest: dict[str, Mapping[str, Any]] = {}
        self._believed: dict[str, Mapping[str, Any]] = {}
        self._usable: Counter[str] = Counter()
        self.clock: Mapping[str, Any] | None = None
        """The newest clock line."""
        self.pictures = Counter({True: 0, False: 0})
        """Delivered, and left out by a busy camera."""

    def take_targets(self, lines: Iterable[Mapping[str, Any]]) -> None:
        """Lines of the service's recording."""
        for line in lines:
            match line["type"]:
                case "header" | "origin" if line["origin"] is not None:
                    place = line["origin"]
                    self._plane = TangentPlane(Geodetic.from_degrees(place["lat"], place["lon"], place["alt_amsl"]))
                case "target":
                    self._newest[line["label"]] = line
                    if line["state"] in BELIEVED:
                        self._believed[line["label"]] = line
                case "clock":
                    self.clock = line

    def take_truth(self, lines: Iterable[Mapping[str, Any]]) -> None:
        """Lines of the mock."""
        for line in lines:
            if line["type"] == "header":
                for target in line["targets"]:
                    place = Geodetic.from_degrees(target["lat"], target["lon"], target["alt_amsl"])
                    self._truth[target["label"]] = place

    def take_pictures(self, lines: Iterable[Mapping[str, Any]]) -> None:
        """Lines of the mock's camera."""
        for line in lines:
            self.pictures[line["delivered"]] += 1
            if line["delivered"]:
                self._usable.update(f"tag36h11:{tag['tag_id']}" for tag in line["tags"] if tag["usable"])

    def scores(self) -> list[Score]:
        """Every target there is, by its number."""
        return sorted((self._score(label) for label in self._truth), key=lambda score: score.id)

    def _score(self, label: str) -> Score:
        line = self._believed.get(label) or self._newest.get(label)
        if line is None:
            return Score(label, "", 0.0, 0.0, False, None, None, None, self._usable[label])
        found, error_m = label in self._believed, None
        if self._plane is not None:
            true = self._plane.ned_from_geodetic(self._truth[label])
            error_m = hypot(line["north"] - true[0], line["east"] - true[1])
        return Score(
            label,
            self._newest[label]["state"],
            line["north"],
            line["east"],
            found,
            error_m,
            circle_radius(line["cov"], 0.95),
            circle_radius(line["cov"], 0.999),
            self._usable[label],
        )
