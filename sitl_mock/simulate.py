"""A whole flight in simulated or real time: vehicle, camera and truth in one order of time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from typing import Any, Protocol

from sitl_mock.camera import FrameTruth, MockCamera
from sitl_mock.clock import BootClock, SimulatorTime
from sitl_mock.draws import draw
from sitl_mock.earth import Place, World
from sitl_mock.flight import Flight, SimulatedFlight, State
from sitl_mock.lander import Lander
from sitl_mock.options import Options
from sitl_mock.scene import targets
from sitl_mock.surface import Surface
from sitl_mock.vehicle import MockVehicle


@dataclass(frozen=True)
class VehicleTruth:
    """True state of the vehicle and positions of the targets at an instant. World's NED; angles in radians."""

    host_ns: int
    boot_ns: int
    position: tuple[float, float, float]
    velocity: tuple[float, float, float]
    euler: tuple[float, float, float]
    rates: tuple[float, float, float]
    targets: tuple[tuple[float, float, float], ...]


What = bytes | dict[str, Any] | FrameTruth | VehicleTruth
"""Bytes from the autopilot; detections of a frame; truth about a frame (just before its detections); true vehicle
state."""
Event = tuple[int, What]
"""(host instant of arrival, ns; content)."""


class Peer(Protocol):
    """A companion that is driven in simulated time: each call returns the bytes that it sends at once."""

    @property
    def wake_at(self) -> int | None:
        """Instant of its next timer."""

    def on_wake(self, now_ns: int) -> list[bytes]:
        """Runs its timer."""

    def on_bytes(self, data: bytes, now_ns: int) -> list[bytes]:
        """Receives bytes from the autopilot."""

    def on_frame(self, frame: dict[str, Any], now_ns: int) -> list[bytes]:
        """Receives detections, by the contract."""


class Simulation:
    """One flight: iterate over its events and pass the companion's bytes to :meth:`on_bytes`; or :meth:`drive` does
    both.
    """

    def __init__(
        self, options: Options, start_host_ns: int | None = None, unix_minus_host_s: float | None = None
    ) -> None:
        self.options = options
        self.start_host_ns = round(options.start_host_s * 1e9) if start_host_ns is None else start_host_ns
        simulated_s = options.start_unix_s - options.start_host_s
        self.unix_minus_host_s = simulated_s if unix_minus_host_s is None else unix_minus_host_s
        self.biases = draw(options)
        autopilot = options.autopilot
        time = SimulatorTime(autopilot.clock_rate, autopilot.clock_slips)
        simulated = autopilot.clock_rate != 1.0 or bool(autopilot.clock_slips)
        self.scene = targets(options)
        self.lander = Lander(options, self.scene[0]) if options.flight.pattern == "landing" else None
        motion = (options.flight, options.seed)
        self.flight = SimulatedFlight(*motion, time, self.lander) if simulated else Flight(*motion, self.lander)
        self.world = World(Place(*options.origin))
        self.surface = Surface(options)
        boot_ns = round(options.autopilot.boot_at_start_s * 1e9)
        self.clock = BootClock(self.start_host_ns, boot_ns, options.autopilot.drift_ppm, time)
        common = (options, self.biases, self.flight)
        self.vehicle = MockVehicle(
            *common, self.world, self.scene, self.clock, self.start_host_ns, self.unix_minus_host_s, self.lander
        )
        self.camera = MockCamera(
            *common, self.scene, self.clock, self.start_host_ns, self.unix_minus_host_s, self.vehicle.belief.gimbal
        )
        self.end_ns = self.start_host_ns + round(options.seconds * 1e9)
        self.frames = 0
        self._truth_at = self.start_host_ns if options.truth_hz else None
        self._waiting: list[tuple[int, int, What]] = []
        self._order = count()

    def on_bytes(self, data: bytes, now_ns: int) -> None:
        """Sends bytes of the companion at this instant; answers follow as later events."""
        self.vehicle.on_bytes(data, now_ns)

    @property
    def wake_at(self) -> int | None:
        """Instant of the next event; None: the flight is over."""
        due = self._waiting[0][0] if self._waiting else self.end_ns + 1
        for at in (self.vehicle.wake_at, self.camera.wake_at, self._truth_at):
            if at is not None and at < due:
                due = at
        return None if due > self.end_ns else due

    def advance(self, now_ns: int) -> list[Event]:
        """Returns what arrives by now, in order of time."""
        for at, data in self.vehicle.advance(now_ns):
            self._wait(at, data)
        for at, frame, truth in self.camera.advance(now_ns):
            self.frames += 1
            self._wait(at, truth)
            self._wait(at, frame)
        while self._truth_at is not None and self._truth_at <= now_ns:
            self._wait(self._truth_at, self.truth_at(self._truth_at))
            self._truth_at += round(1e9 / self.options.truth_hz)
        events = []
        while self._waiting and self._waiting[0][0] <= now_ns:
            at, _, what = heappop(self._waiting)
            events.append((at, what))
        return events

    def __iter__(self) -> Iterator[Event]:
        """Yields every event up to the end, as fast as it can be computed."""
        while (at := self.wake_at) is not None:
            yield from self.advance(at)

    def drive(self, peer: Peer) -> Iterator[Event]:
        """Runs a companion through the flight, its timers at their own instants; yields the events that it received."""
        while (at := self.wake_at) is not None:
            wake = peer.wake_at
            if wake is not None and wake < at:
                self._sent(peer.on_wake(wake), wake)
                continue
            for now_ns, what in self.advance(at):
                if isinstance(what, bytes):
                    self._sent(peer.on_bytes(what, now_ns), now_ns)
                elif isinstance(what, dict):
                    self._sent(peer.on_frame(what, now_ns), now_ns)
                yield now_ns, what

    def state_at(self, host_ns: int) -> State:
        """True state of the vehicle at a host instant."""
        return self.flight.at(self.flight_s(host_ns))

    def flight_s(self, host_ns: int) -> float:
        """Seconds since the start."""
        return (host_ns - self.start_host_ns) * 1e-9

    def truth_at(self, host_ns: int) -> VehicleTruth:
        """Truth about the vehicle and the targets at a host instant."""
        state = self.state_at(host_ns)
        return VehicleTruth(
            host_ns,
            self.clock.boot_ns(host_ns),
            state.position,
            state.velocity,
            state.euler,
            state.rates,
            tuple(target.at(state.flight_s) for target in self.scene),
        )

    def _wait(self, at_ns: int, what: What) -> None:
        heappush(self._waiting, (at_ns, next(self._order), what))

    def _sent(self, frames: list[bytes], now_ns: int) -> None:
        for frame in frames:
            self.on_bytes(frame, now_ns)


def simulate(options: Options | None = None) -> Simulation:
    """A flight in simulated time; iterating gives (host_ns, content) in order of time."""
    return Simulation(options or Options())
