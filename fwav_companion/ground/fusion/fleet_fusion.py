"""Fusion of many vehicles' tracks to one picture. Pure: it is handed the time."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field

import numpy as np

from fwav_companion.fleet.payloads import MAX_TRACKS
from fwav_companion.ground.fusion import association
from fwav_companion.ground.fusion.bias_solution import SMALLEST_SIGMA, solution_slices
from fwav_companion.ground.fusion.consistency import RIGHT, WRONG, VehicleShift, shift_of, wrong_by_biases
from fwav_companion.ground.fusion.fused_targets import FusedTarget, TargetBooks
from fwav_companion.ground.fusion.place_index import PlaceIndex
from fwav_companion.ground.fusion.rebuilding import improved
from fwav_companion.ground.fusion.reported_tracks import Array, ReportedTrack, ReportingVehicle
from fwav_companion.ground.views import MAX_VEHICLES

FRESH_S = 5.0
"""Age of a vehicle's report beyond which its tracks no longer count: at 2 Hz ten reports are missing."""
LOOK_S = 2.0
"""Interval at which each vehicle's shift is examined."""
REBUILD_S = 5.0
"""Interval at which the association is rebuilt for comparison."""
MOST_NEW_TRACKS = 1024
"""Most tracks without a target that one step associates, those of the newest reports first: 0.2 s of work."""
ADMIT_S = 10.0
"""Time for which a vehicle that was left out must agree before it counts again."""


@dataclass(slots=True)
class LeftOut:
    """A vehicle that is left out of the fusion."""

    reason: str
    agrees_unix: float | None = None
    """Instant since which it has agreed with the others, Unix seconds; None while it does not."""
    pairs: dict[int, int] = field(default_factory=dict)


@dataclass(slots=True)
class FusionReport:
    """Events that people must know: each is reported once, when it begins or ends."""

    texts: list[tuple[str, str, bool]] = field(default_factory=list)
    """(vehicle, text, whether it is a warning) of each event."""


class FleetFusion:
    """Vehicles, their tracks, and the targets that they see together."""

    def __init__(self) -> None:
        self.vehicles: dict[str, ReportingVehicle] = {}
        self.left_out: dict[str, LeftOut] = {}
        self.disagreements: set[frozenset[str]] = set()
        """Pairs of vehicles that disagree, without a third that decides."""
        self._books = TargetBooks()
        self._looked_unix: dict[str, float] = {}
        self._rebuilt_unix = 0.0
        self._report = FusionReport()
        self._waiting: dict[str, tuple[Sequence[ReportedTrack], Array, float]] = {}
        """Reports that came within a step, by vehicle."""
        self._stepping = False
        self._overloaded = False

    @property
    def targets(self) -> list[FusedTarget]:
        """The fused targets."""
        return list(self._books.targets.values())

    def on_tracks(self, name: str, tracks: Sequence[ReportedTrack], sigmas: Array, now: float) -> bool:
        """Replace the tracks of a vehicle; false if there is no room for another vehicle.

        Within a step, the report waits for its end; a newer one of the vehicle replaces it.
        """
        if self._stepping and name in self.vehicles:
            self._waiting[name] = (tracks, sigmas, now)
            return True
        vehicle = self.vehicles.get(name)
        if vehicle is None:
            if len(self.vehicles) >= MAX_VEHICLES:
                return False
            vehicle = self.vehicles[name] = ReportingVehicle(name, sigmas)
        prior = np.maximum(sigmas, SMALLEST_SIGMA) ** 2
        if vehicle.heard_unix == 0.0 or (np.diag(vehicle.bias_cov) > prior).any():
            vehicle.bias_cov = np.diag(prior)  # a solution is never wider than its prior: this one had another
        vehicle.sigmas, vehicle.heard_unix = sigmas, now
        vehicle.tracks = {track.track: track for track in tracks[:MAX_TRACKS]}
        return True

    def take_report(self) -> FusionReport:
        """Events since the last call."""
        report, self._report = self._report, FusionReport()
        return report

    def step(self, now: float) -> None:
        """Associate, solve and examine. Called about twice a second."""
        for _ in self.slices(now):
            pass

    def slices(self, now: float) -> Generator[None]:
        """One step in slices of some milliseconds: it pauses after each."""
        self._stepping = True
        try:
            yield from self._step(now)
        finally:
            self._stepping = False
            waiting, self._waiting = self._waiting, {}
            for name, (tracks, sigmas, heard) in waiting.items():
                self.on_tracks(name, tracks, sigmas, heard)

    def _step(self, now: float) -> Generator[None]:
        for name in [each.name for each in self.vehicles.values() if now > each.heard_unix + FRESH_S]:
            self._forget(name)
        counting = {name: vehicle for name, vehicle in self.vehicles.items() if name not in self.left_out}
        yield from association.release(self._books, counting, now)
        yield
        index = PlaceIndex(self._books.targets.values())
        yield
        yield from self._associate(counting, index, now)
        yield from self._solve(counting, now)
        yield
        yield from association.merge_targets(self._books)
        if now >= self._rebuilt_unix + REBUILD_S and not self._overloaded:
            self._rebuilt_unix = now
            self._books = (yield from improved(self._books, counting, now)) or self._books
        yield from self._examine(counting, now)
        self._mark_left_out()

    def _associate(self, counting: dict[str, ReportingVehicle], index: PlaceIndex, now: float) -> Generator[None]:
        """Associate the tracks without a target, those of the newest reports first, and report those that wait."""
        left, waiting, behind = MOST_NEW_TRACKS, 0, set[str]()
        for vehicle in sorted(counting.values(), key=lambda each: (-each.heard_unix, each.name)):
            known = sum(1 for track in vehicle.tracks if (vehicle.name, track) in self._books.of_track)
            wait = association.associate(self._books, vehicle, index, now, most=left)
            associated = sum(1 for track in vehicle.tracks if (vehicle.name, track) in self._books.of_track) - known
            left, waiting = left - associated, waiting + wait
            if wait:
                behind.add(vehicle.name)
            yield
        if behind and not self._overloaded:
            text = f"the fusion is overloaded: {waiting} tracks of {len(behind)} vehicles wait, the oldest reports"
            self._report.texts.append((min(behind), text, True))
        self._overloaded = bool(behind)

    def _solve(self, counting: dict[str, ReportingVehicle], now: float) -> Generator[None]:
        """Solve for the positions of all targets, and for the biases of all vehicles with a common target."""
        books = self._books
        keys = [key for key in books.of_track if key[0] in counting]
        if not keys:
            return
        names = {name: index for index, name in enumerate(dict.fromkeys(key[0] for key in keys))}
        order = {target_id: index for index, target_id in enumerate(books.targets)}
        tracks = [counting[name].tracks[track] for name, track in keys]
        # Differences from the middle keep the digits: a plane may reach over hundreds of kilometres.
        yield
        positions = np.array([track.at(now) for track in tracks])
        middle = positions.mean(axis=0)
        yield
        solution = yield from solution_slices(
            tracks,
            positions - middle,
            vehicles=np.array([names[name] for name, _ in keys]),
            targets=np.array([order[books.of_track[key]] for key in keys]),
            sigmas=np.array([counting[name].sigmas for name in names]),
            target_count=len(order),
        )
        for name, index in names.items():
            counting[name].bias, counting[name].bias_cov = solution.biases[index], solution.bias_covs[index]
        for target_id, index in order.items():
            if index % association.SHARE == 0:
                yield
            target = books.targets[target_id]
            target.position, target.cov = solution.targets[index] + middle, solution.target_covs[index]
            _fuse_heights(target, [counting[name].tracks[track] for name, track in target.members.items()])

    def _examine(self, counting: dict[str, ReportingVehicle], now: float) -> Generator[None]:
        """Leave out a vehicle that is wrong, and admit one that is right again. It pauses after each vehicle."""
        worst = wrong_by_biases(counting, self.targets)
        if worst is not None:
            bias = counting[worst[0]].bias
            self._leave_out(worst[0], float(np.hypot(bias[0], bias[1])))
        index: PlaceIndex | None = None
        for name, vehicle in list(self.vehicles.items()):
            if now < self._looked_unix.get(name, -LOOK_S) + LOOK_S:
                continue
            self._looked_unix[name] = now
            if index is None:
                index = PlaceIndex(self._books.targets.values())
            shift = shift_of(vehicle, index, now)
            if name in self.left_out:
                self._maybe_admit(name, shift, now)
            else:
                self._on_shift(name, shift)
            yield

    def _on_shift(self, name: str, shift: VehicleShift | None) -> None:
        if shift is None:
            return
        if shift.nis <= RIGHT:
            self._agrees(name)
        elif shift.nis <= WRONG:
            return
        elif shift.corroborated:
            self._leave_out(name, shift.length_m)
            self.left_out[name].pairs = shift.pairs
        elif len(shift.others) == 1:
            pair = frozenset((name, shift.others[0]))
            if pair not in self.disagreements:
                self.disagreements.add(pair)
                first, second = sorted(pair)
                text = f"disagrees with vehicle {second} by {shift.length_m:.1f} m: check the positions of both"
                self._report.texts.append((first, text, True))

    def _agrees(self, name: str) -> None:
        """End the disagreements of this vehicle, and report them."""
        for pair in [pair for pair in self.disagreements if name in pair]:
            self.disagreements.discard(pair)
            first, second = sorted(pair)
            self._report.texts.append((first, f"agrees with vehicle {second} again", False))

    def _leave_out(self, name: str, by_m: float) -> None:
        reason = f"{by_m:.1f} m from where others see the same targets"
        self.left_out[name] = LeftOut(reason)
        for pair in [pair for pair in self.disagreements if name in pair]:
            self.disagreements.discard(pair)
        self._remove_tracks(name)
        vehicle = self.vehicles[name]
        vehicle.bias = np.zeros_like(vehicle.bias)
        vehicle.bias_cov = np.diag(np.maximum(vehicle.sigmas, SMALLEST_SIGMA) ** 2)
        self._report.texts.append((name, f"left out: {reason}. Check its position and heading", True))

    def _maybe_admit(self, name: str, shift: VehicleShift | None, now: float) -> None:
        left = self.left_out[name]
        if shift is not None:
            left.pairs = shift.pairs
        if shift is None or shift.nis > RIGHT:
            left.agrees_unix = None
        elif left.agrees_unix is None:
            left.agrees_unix = now
        elif now >= left.agrees_unix + ADMIT_S:
            del self.left_out[name]
            self._report.texts.append((name, "agrees with the others again: counts", False))

    def _mark_left_out(self) -> None:
        """Record at each target the left-out vehicles that see it."""
        for target in self._books.targets.values():
            target.left_out = {}
        for name, left in self.left_out.items():
            for target_id in left.pairs.values():
                if target_id in self._books.targets:
                    self._books.targets[target_id].left_out[name] = left.reason

    def _remove_tracks(self, name: str) -> None:
        for key in [key for key in self._books.of_track if key[0] == name]:
            self._books.leave(*key)

    def _forget(self, name: str) -> None:
        """Forget a silent vehicle; its liveliness token reports the silence."""
        self._remove_tracks(name)
        del self.vehicles[name]
        self.left_out.pop(name, None)
        self._looked_unix.pop(name, None)
        self.disagreements = {pair for pair in self.disagreements if name not in pair}


def _fuse_heights(target: FusedTarget, tracks: Sequence[ReportedTrack]) -> None:
    """Fuse the heights by covariance intersection with weights by information: their common errors are not known."""
    information = [1.0 / max(track.down_variance, 1e-4) for track in tracks]
    total = sum(information)
    target.down_m = sum(weight * track.down_m for weight, track in zip(information, tracks, strict=True)) / total
    target.down_variance = len(tracks) / total
    target.seen_unix = max(track.seen_unix for track in tracks)
    target.confirmed = any(track.confirmed for track in tracks)
