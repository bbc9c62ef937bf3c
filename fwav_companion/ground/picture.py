"""The picture: all known vehicles, targets and texts, with a limit on the number of each. Pure.

Each entry keeps the revision of its last change, so that a reader gets the changes since its last visit. No queue is
needed: a slow reader skips states.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from math import cos, hypot, radians
from typing import Any

from msgspec.structs import replace

from fwav_companion.ground.evidence import SILENT_S, STATED_BY, SilenceTexts, newest, silent_parts
from fwav_companion.ground.views import (
    MAX_VEHICLES,
    PastPoint,
    PictureUpdate,
    SourceView,
    TargetView,
    TextView,
    VehicleView,
    is_place,
    within_range,
)

MAX_TARGETS = 2000
MAX_TEXTS = 200
MAX_HISTORY = 600
"""Most points of a history: ten minutes at one point a second."""
MAX_REMOVED = 2 * MAX_TARGETS
"""Most removals that are remembered; a reader that missed older ones gets the whole picture."""
MAX_TEXT = 200
"""Most characters of a text that are kept."""
MAX_WORDS = 300
"""Most characters of any other text of a vehicle."""
GONE_S = 60.0
"""Time after which a lost or dropped target disappears, and after which a silent vehicle may yield its place."""
FORGOTTEN_S = 1800.0
"""Time without a report after which any target disappears."""
REPEAT_S = 10.0
"""Time in which the same text of a vehicle is one text: it may come by two links."""
HISTORY_STEP_S = 1.0
PATH_STEP_M = 0.5
METRES_A_DEGREE = 111_320.0
PRECEDENCE = {"text": 0, "mavlink": 1, "recording": 1, "status": 2, "fleet": 2, "fused": 3}
"""Rank of each kind of input: if two report the same target, the higher one counts while it is fresh."""
FRESH_S = 3.0
ENDED = frozenset({"lost", "dropped"})
IMPOSSIBLE_PLACE = "its position is none on the earth. Check what sends it"
WARNING = 4
"""MAV_SEVERITY_WARNING."""
NOTICE = 5


class GroundPicture:
    """Joins all inputs. ``now`` is this process's clock in Unix seconds, which never steps."""

    def __init__(self) -> None:
        self.revision = 0
        self.refused = 0
        """Number of reports of vehicles and targets for which there was no room."""
        self._vehicles: dict[str, VehicleView] = {}
        self._targets: dict[str, TargetView] = {}
        self._texts: deque[TextView] = deque(maxlen=MAX_TEXTS)
        self._sources: dict[str, SourceView] = {}
        self._removed: deque[tuple[int, str]] = deque(maxlen=MAX_REMOVED)
        self._forgotten_revision = 0
        self._covered: frozenset[str] = frozenset()
        self._first_unix: dict[str, float] = {}
        """Instant of each vehicle's first message."""
        self._appeared = 0
        """Number of vehicles that have appeared."""
        self._paths: dict[str, deque[PastPoint]] = {}
        self._histories: dict[str, deque[PastPoint]] = {}
        self._reported: dict[str, float] = {}
        """Instant of the newest report of each target."""
        self._silences = SilenceTexts()

    # What comes in.

    def on_vehicle(
        self, vehicle: str, now: float, *, heard: Mapping[str, float | None] | None = None, **changes: Any
    ) -> None:
        """Change fields of a vehicle; an unknown one is added where there is room.

        ``heard``: the instants of the evidence for these changes, by part and value; without one nothing is newer.
        None: nothing is known of this part any longer.
        """
        known = self._vehicles.get(vehicle)
        if known is None:
            if len(self._vehicles) >= MAX_VEHICLES and not self._forgot_vehicle(now):
                self.refused += 1
                self._source_full()
                return
            known = VehicleView(id=vehicle, number=self._appeared, heard_unix=now)
            self._appeared += 1
            self._first_unix[vehicle] = now
            self.say(vehicle, "heard for the first time", now, severity=NOTICE)
        if "lat" in changes and not is_place(changes["lat"], changes["lon"], changes.get("alt_amsl")):
            changes = {name: value for name, value in changes.items() if name not in ("lat", "lon", "alt_amsl")}
            heard = {name: at for name, at in (heard or {}).items() if name != "position"}
            self.say(vehicle, IMPOSSIBLE_PLACE, now, severity=WARNING)
        changes = {name: each[:MAX_WORDS] if isinstance(each, str) else each for name, each in changes.items()}
        instants = dict(known.heard)
        for name, at in (heard or {}).items():
            if at is None:
                instants.pop(name, None)
            else:
                instants[name] = max(min(at, now), instants.get(name, 0.0))  # nothing is evidence of the future
        changed = replace(known, **changes, heard=instants, heard_unix=newest(instants, known.heard_unix))
        self._vehicles[vehicle] = replace(_with_evidence_at(changed, known, now), revision=self._next())
        if "lat" in changes and changes["lat"] is not None:
            self._extend_path(vehicle, PastPoint(now, changes["lat"], changes["lon"]))

    def on_target(self, target: TargetView, now: float) -> None:
        """Add or replace a target. Its ``first_unix`` remains that of the first report."""
        if target.id in self._covered:
            return
        if not is_place(target.lat, target.lon, target.alt_amsl):
            self.say(target.vehicle, f"a target was left out: {IMPOSSIBLE_PLACE}", now, severity=WARNING)
            return
        target = within_range(target, now)
        known = self._targets.get(target.id)
        if known is None and len(self._targets) >= MAX_TARGETS and not self._made_room():
            self.refused += 1
            self._source_full()
            return
        if known is not None and _knows_more(known, target, now - self._reported[target.id]):
            return
        first = target.first_unix if known is None else min(known.first_unix, target.first_unix)
        since = _since(target.contradicted, known, now)
        self._targets[target.id] = replace(target, revision=self._next(), first_unix=first, contradicted_unix=since)
        self._reported[target.id] = now
        history = self._histories.setdefault(target.id, deque(maxlen=MAX_HISTORY))
        if not history or now >= history[-1].time_unix + HISTORY_STEP_S:
            history.append(PastPoint(now, target.lat, target.lon, target.radius95_m))

    def remove_target(self, target: str) -> None:
        """Remove a target; the readers are informed."""
        if self._targets.pop(target, None) is None:
            return
        self._histories.pop(target, None)
        self._reported.pop(target, None)
        if len(self._removed) == MAX_REMOVED:
            self._forgotten_revision = self._removed[0][0]
        self._removed.append((self._next(), target))

    def cover(self, targets: frozenset[str]) -> None:
        """Hide these targets until the next call: fused targets replace them."""
        self._covered = targets
        for target in targets & self._targets.keys():
            self.remove_target(target)

    def say(self, vehicle: str, text: str, now: float, *, severity: int) -> None:
        """Append a text, unless the vehicle has just said the same."""
        shown = "".join(one if one.isprintable() else " " for one in text[:MAX_TEXT])
        if any(
            each.text == shown and each.vehicle == vehicle and now < each.time_unix + REPEAT_S for each in self._texts
        ):
            return
        self._texts.append(
            TextView(revision=self._next(), time_unix=now, vehicle=vehicle, severity=severity, text=shown)
        )

    def on_silence_reported(self, vehicle: str, part: str) -> None:
        """Leave the silence of a part to the vehicle's own texts, which have reported it: it is said once."""
        self._silences.on_reported(vehicle, part)

    def on_source(self, name: str, works: bool, text: str) -> None:
        """Set the state of an input."""
        if self._sources.get(name) != (source := SourceView(name=name, works=works, text=text)):
            self._sources[name] = source
            self._next()

    def advance(self, now: float) -> None:
        """Report what fell silent or came back, and remove targets that ended or were not reported for long."""
        for known in list(self._vehicles.values()):
            vehicle = _with_evidence_at(known, known, now)
            if vehicle is not known:
                self._vehicles[known.id] = replace(vehicle, revision=self._next())
            for text, is_warning in self._silences.due(vehicle, now):
                self.say(known.id, text, now, severity=WARNING if is_warning else NOTICE)
        for target in list(self._targets.values()):
            limit_s = GONE_S if target.state in ENDED else FORGOTTEN_S
            if now > target.seen_unix + limit_s:
                self.remove_target(target.id)

    # What is read.

    @property
    def vehicles(self) -> dict[str, VehicleView]:
        """Vehicles by id."""
        return self._vehicles

    @property
    def targets(self) -> dict[str, TargetView]:
        """Targets by id."""
        return self._targets

    def update_since(self, revision: int, now: float) -> PictureUpdate:
        """Changes after ``revision``; the whole picture if it is 0, unknown, or too long ago."""
        whole = not max(1, self._forgotten_revision) <= revision <= self.revision
        since = 0 if whole else revision
        return PictureUpdate(
            revision=self.revision,
            whole=whole,
            now_unix=now,
            vehicles=[each for each in self._vehicles.values() if each.revision > since],
            targets=[each for each in self._targets.values() if each.revision > since],
            removed=[] if whole else [target for at, target in self._removed if at > since],
            texts=[each for each in self._texts if each.revision > since],
            sources=list(self._sources.values()),
        )

    def paths(self) -> dict[str, list[PastPoint]]:
        """Past places of every vehicle, the oldest first."""
        return {vehicle: list(path) for vehicle, path in self._paths.items()}

    def history(self, target: str) -> list[PastPoint]:
        """Past states of a target, the oldest first; empty for an unknown one."""
        return list(self._histories.get(target, ()))

    def _extend_path(self, vehicle: str, point: PastPoint) -> None:
        path = self._paths.setdefault(vehicle, deque(maxlen=MAX_HISTORY))
        if path:
            north = (point.lat - path[-1].lat) * METRES_A_DEGREE
            east = (point.lon - path[-1].lon) * METRES_A_DEGREE * cos(radians(point.lat))
            if hypot(north, east) < PATH_STEP_M:
                return
        path.append(point)

    def _made_room(self) -> bool:
        """Remove one target that has ended; false if none has."""
        ended = next((each.id for each in self._targets.values() if each.state in ENDED), None)
        if ended is None:
            return False
        self.remove_target(ended)
        return True

    def _forgot_vehicle(self, now: float) -> bool:
        """Forget one vehicle that has been silent for GONE_S; false if none has.

        It is the one that was heard for the shortest time: the last place of a vehicle that flew is what is searched.
        """
        gone = [each for each in self._vehicles.values() if now > each.heard_unix + GONE_S]
        if not gone:
            return False
        shortest = min(gone, key=lambda each: each.heard_unix - self._first_unix[each.id])
        for kept in (self._vehicles, self._paths, self._first_unix):
            kept.pop(shortest.id, None)
        self._silences.forget(shortest.id)
        self._forgotten_revision = self._next()  # an update does not list vehicles that are gone
        return True

    def _source_full(self) -> None:
        text = f"full: at most {MAX_VEHICLES} vehicles and {MAX_TARGETS} targets; {self.refused} reports were left out"
        self.on_source("picture", works=False, text=text)

    def _next(self) -> int:
        self.revision += 1
        return self.revision


def readiness_fields(known: VehicleView | None, *, ready: bool, trouble: str) -> dict[str, Any]:
    """Fields of a vehicle by its present readiness; a text of the vehicle itself that says the same remains."""
    if ready and known is not None and known.ready:
        return {"ready": True}
    return {"ready": ready, "readiness": "ready" if ready else f"not ready: {trouble}"}


def _with_evidence_at(vehicle: VehicleView, known: VehicleView, now: float) -> VehicleView:
    """The vehicle with what its evidence is worth now. ``known``: the vehicle before its changes."""
    quiet, silent = silent_parts(vehicle.heard, now), now > vehicle.heard_unix + SILENT_S
    ready = None if silent or not quiet.keys().isdisjoint(STATED_BY) else vehicle.ready
    unchanged = (quiet, silent, ready, vehicle.contradicted)
    if vehicle is known and unchanged == (known.quiet, known.silent, known.ready, known.contradicted):
        return known
    return replace(
        vehicle,
        quiet=quiet,
        silent=silent,
        ready=ready,
        ready_unix=known.ready_unix if ready is known.ready else now,
        contradicted_unix=_since(vehicle.contradicted, known, now),
    )


def _since(contradicted: str, known: VehicleView | TargetView | None, now: float) -> float | None:
    """Instant since which a claim is contradicted; None where it is not."""
    if not contradicted:
        return None
    return now if known is None or known.contradicted_unix is None else known.contradicted_unix


def _knows_more(known: TargetView, target: TargetView, age_s: float) -> bool:
    """Whether the present report of the target, of this age, is fresh and came from a better input."""
    return age_s <= FRESH_S and PRECEDENCE.get(known.source, 0) > PRECEDENCE.get(target.source, 0)


def targets_of(picture: GroundPicture, source: str) -> Iterable[TargetView]:
    """Targets that came from one kind of input."""
    return [each for each in picture.targets.values() if each.source == source]
