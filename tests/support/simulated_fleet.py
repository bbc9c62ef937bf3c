"""Fleets in simulated time whose truth is chosen first: targets, biases of each vehicle, noise that averages away."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fwav_companion.ground.fusion.fleet_fusion import FleetFusion
from fwav_companion.ground.fusion.reported_tracks import ReportedTrack

STEP_S = 0.5
START = 1_790_000_000.0
LABELS = ("person", "car")


@dataclass(kw_only=True)
class FleetOptions:
    vehicles: int = 3
    targets: int = 10
    seen_each: int = 10
    """Targets that a vehicle sees: the nearest to it."""
    extent_m: float = 60.0
    spacing_m: float = 5.0
    own_sigma_m: float = 1.0
    shared_sigma_m: float = 0.0
    """Of the error that all vehicles have in common."""
    claimed_shared_m: float = 0.5
    """[fleet] gnss_shared_m."""
    heading_sigma: float = 0.035
    noise_m: float = 0.5
    """Noise of one second; it averages away."""
    floor_m: float = 0.1
    loss: float = 0.1
    wrong: tuple[int, ...] = ()
    """Vehicles whose position is off by wrong_m."""
    wrong_m: float = 10.0
    wrong_from_s: float = 0.0


@dataclass
class SimulatedVehicle:
    name: str
    bias: np.ndarray
    sees: list[int]
    arms: dict[int, np.ndarray] = field(default_factory=dict)
    """Mean offset of each target from the vehicle while it was seen."""
    noise: dict[int, np.ndarray] = field(default_factory=dict)


class SimulatedFleet:
    """A fleet and its truth."""

    def __init__(self, options: FleetOptions, seed: int) -> None:
        self.options, self.draw = options, np.random.default_rng(seed)
        self.truth = self._targets()
        self.labels = [LABELS[index % len(LABELS)] for index in range(len(self.truth))]
        shared = self.draw.normal(0.0, options.shared_sigma_m, 2)
        self.vehicles = [self._vehicle(index, shared) for index in range(options.vehicles)]
        self.seconds = 0.0

    @property
    def now(self) -> float:
        return START + self.seconds

    def _targets(self) -> np.ndarray:
        places: list[np.ndarray] = []
        while len(places) < self.options.targets:
            place = self.draw.uniform(-0.5, 0.5, 2) * self.options.extent_m
            if all(np.hypot(*(place - other)) >= self.options.spacing_m for other in places):
                places.append(place)
        return np.array(places)

    def _vehicle(self, index: int, shared: np.ndarray) -> SimulatedVehicle:
        options, draw = self.options, self.draw
        own = draw.normal(0.0, 1.0, 3) * [options.own_sigma_m, options.own_sigma_m, options.heading_sigma]
        own[:2] += shared
        at = draw.uniform(-0.5, 0.5, 2) * options.extent_m
        sees = np.argsort(np.hypot(*(self.truth - at).T))[: options.seen_each].tolist()
        vehicle = SimulatedVehicle(str(index + 1), own, sees)
        for target in sees:
            vehicle.arms[target] = draw.uniform(-15.0, 15.0, 2)
        turn = draw.uniform(0.0, 2.0 * np.pi)
        self._wrong_way = np.array([np.cos(turn), np.sin(turn)])
        return vehicle

    def reports(self, vehicle: SimulatedVehicle) -> tuple[list[ReportedTrack], np.ndarray]:
        """Tracks of a vehicle now, and its claimed sigmas."""
        options = self.options
        shared_m = min(options.claimed_shared_m, float(np.hypot(options.own_sigma_m, options.shared_sigma_m)))
        total2 = options.own_sigma_m**2 + options.shared_sigma_m**2
        own_m = float(np.sqrt(max(total2 - shared_m**2, 0.0)))
        tracks = []
        for number, target in enumerate(vehicle.sees, 1):
            north, east = vehicle.arms[target]
            jacobian = np.array([[1.0, 0.0, -east], [0.0, 1.0, north]])
            variance = options.noise_m**2 / (1.0 + self.seconds) + options.floor_m**2
            position = self.truth[target] + jacobian @ self.bias_of(vehicle) + self._noise(vehicle, target, variance)
            tracks.append(
                ReportedTrack(
                    vehicle=vehicle.name, track=number, label=self.labels[target], confirmed=True, position=position,
                    noise=variance * np.eye(2), shared=shared_m**2 * np.eye(2), jacobian=jacobian,
                    at_unix=self.now, seen_unix=self.now,
                )
            )  # fmt: skip
        return tracks, np.array([own_m, own_m, options.heading_sigma])

    def bias_of(self, vehicle: SimulatedVehicle) -> np.ndarray:
        bias = vehicle.bias.copy()
        if int(vehicle.name) - 1 in self.options.wrong and self.seconds >= self.options.wrong_from_s:
            bias[:2] += self.options.wrong_m * self._wrong_way
        return bias

    def _noise(self, vehicle: SimulatedVehicle, target: int, variance: float) -> np.ndarray:
        """The averaged noise: it changes slowly, and has the claimed variance at every instant."""
        unit = vehicle.noise.get(target)
        fresh = self.draw.normal(0.0, 1.0, 2)
        vehicle.noise[target] = fresh if unit is None else 0.95 * unit + np.sqrt(1.0 - 0.95**2) * fresh
        return np.sqrt(variance) * vehicle.noise[target]

    def run(self, fusion: FleetFusion, seconds: float):
        """Fly; yields after each step."""
        for _ in range(round(seconds / STEP_S)):
            for vehicle in self.vehicles:
                if self.draw.uniform() >= self.options.loss:
                    fusion.on_tracks(vehicle.name, *self.reports(vehicle), self.now)
            fusion.step(self.now)
            yield
            self.seconds += STEP_S

    def true_target(self, vehicle: str, track: int) -> int:
        """Index of the target that a track is of."""
        return self.vehicles[int(vehicle) - 1].sees[track - 1]

    def once(self, fusion: FleetFusion) -> tuple[int, int]:
        """Targets that the fused picture has once and unmixed, and all targets that a counting vehicle sees."""
        counted: dict[int, int] = {}
        mixed: set[int] = set()
        for target in fusion.targets:
            of = {self.true_target(vehicle, track) for vehicle, track in target.members.items()}
            for index in of:
                counted[index] = counted.get(index, 0) + 1
            if len(of) > 1:
                mixed |= of
        visible = {each for v in self.vehicles if v.name not in fusion.left_out for each in v.sees}
        return sum(counted.get(index, 0) == 1 and index not in mixed for index in visible), len(visible)
