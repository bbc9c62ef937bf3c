"""Comparison of the targets with the truth while they fly: lines of the recording in, a score per target out. Pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from math import hypot
from typing import Any

import msgspec

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.ellipses import circle_radius
from fwav_companion.recording.labels import display_name
from fwav_companion.recording.line_types import ClockEstimateLine, HeaderLine, Line, OriginLine, TargetLine
from fwav_companion.types import TrackState

DUE_FRAMES = 10
"""Delivered pictures with the whole tag, readable, after which the service must have found it."""


class TargetScore(msgspec.Struct, frozen=True):
    """One target against its truth."""

    label: str
    state: str
    """State of the newest line; "" before the first line."""
    north: float
    east: float
    found: bool
    """Whether it was confirmed at any time."""
    error_m: float | None
    claimed95_m: float | None
    """Claimed radius, 95 %, metres."""
    claimed999_m: float | None
    """Claimed radius, 99.9 %, metres."""
    usable_frames: int
    ghosts: int = 0
    """Number of further confirmed tracks with this label at the end: a tag is one target."""

    @property
    def id(self) -> int:
        """The tag's number."""
        return int(self.label.rpartition(":")[2])

    @property
    def name(self) -> str:
        """The target's name for people."""
        return display_name(self.label)

    @property
    def due(self) -> bool:
        """Whether enough pictures showed the tag."""
        return self.usable_frames >= DUE_FRAMES

    @property
    def trouble(self) -> str | None:
        """Why this result fails the demonstration; None if it does not."""
        if not self.found:
            missed = f"{self.name} was readable in {self.usable_frames} pictures and was not found"
            return missed if self.due else None
        if self.error_m is not None and self.claimed999_m is not None and self.error_m > self.claimed999_m:
            return f"{self.name} has an error of {self.error_m:.2f} m, claimed: {self.claimed999_m:.2f} m (99.9 %)"
        return None


class Scoreboard:
    """Collects lines of the service and the mock while they are written, and scores each target."""

    def __init__(self) -> None:
        self._truth: dict[str, Geodetic] = {}
        self._plane: TangentPlane | None = None
        self._newest: dict[str, TargetLine] = {}
        self._confirmed: dict[str, dict[int, TargetLine]] = {}
        """The last confirmed line of each track, by label."""
        self._dropped: set[int] = set()
        """Track numbers."""
        self._usable: Counter[str] = Counter()
        self.clock: ClockEstimateLine | None = None
        """The newest clock line."""
        self.pictures = Counter({True: 0, False: 0})
        """Number of pictures delivered (True) and skipped by a busy machine (False)."""

    def take_targets(self, lines: Iterable[Line]) -> None:
        """Add lines of the service's recording."""
        for line in lines:
            match line:
                case HeaderLine(origin=origin) | OriginLine(origin=origin) if origin is not None:
                    self._plane = origin.plane
                case TargetLine():
                    self._newest[line.label] = line
                    if line.is_confirmed:
                        self._confirmed.setdefault(line.label, {})[line.track] = line
                    elif line.state is TrackState.DROPPED:
                        self._dropped.add(line.track)
                case ClockEstimateLine():
                    self.clock = line

    def take_truth(self, lines: Iterable[Mapping[str, Any]]) -> None:
        """Add lines of the mock autopilot."""
        for line in lines:
            if line["type"] == "header":
                for target in line["targets"]:
                    place = Geodetic.from_degrees(target["lat"], target["lon"], target["alt_amsl"])
                    self._truth[target["label"]] = place

    def take_pictures(self, lines: Iterable[Mapping[str, Any]]) -> None:
        """Add lines of the mock camera."""
        for line in lines:
            self.pictures[line["delivered"]] += 1
            if line["delivered"]:
                self._usable.update(f"tag36h11:{tag['tag_id']}" for tag in line["tags"] if tag["usable"])

    def scores(self) -> list[TargetScore]:
        """The score of each true target, by the tag's number."""
        return sorted((self._score(label) for label in self._truth), key=lambda score: score.id)

    def _score(self, label: str) -> TargetScore:
        if label not in self._newest:
            return TargetScore(
                label=label,
                state="",
                north=0.0,
                east=0.0,
                found=False,
                error_m=None,
                claimed95_m=None,
                claimed999_m=None,
                usable_frames=self._usable[label],
            )
        tracks = self._confirmed.get(label, {})
        alive = [line for track, line in tracks.items() if track not in self._dropped]
        candidates = alive or list(tracks.values())[-1:] or [self._newest[label]]
        # Of several tracks the nearest one is the target, the others are ghosts.
        scored = [(line, self._error_m(label, line)) for line in candidates]
        line, error_m = min(scored, key=lambda pair: pair[1] or 0.0)
        return TargetScore(
            label=label,
            state=self._newest[label].state,
            north=line.north,
            east=line.east,
            found=bool(tracks),
            error_m=error_m,
            claimed95_m=circle_radius(line.cov, 0.95),
            claimed999_m=circle_radius(line.cov, 0.999),
            usable_frames=self._usable[label],
            ghosts=max(0, len(alive) - 1),
        )

    def _error_m(self, label: str, line: TargetLine) -> float | None:
        """Horizontal error of a line, metres; None before the origin is known."""
        if self._plane is None:
            return None
        true = self._plane.ned_from_geodetic(self._truth[label])
        return hypot(line.north - true[0], line.east - true[1])
