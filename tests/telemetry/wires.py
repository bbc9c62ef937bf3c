"""Exchanges and arrivals between two clocks over a wire, in invented time: truth first, then the input of a Clock."""

import random
from collections.abc import Callable
from dataclasses import dataclass, field

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.telemetry.clock.clock import Clock
from fwav_companion.telemetry.clock.clock_news import ClockNews
from fwav_companion.types import ClockEstimate, ClockExchange

HOST_START_NS = 50_000_000_000_000
MS = 1_000_000

Delay = Callable[[random.Random], float]
"""Seconds."""


def exponential(mean_s: float, base_s: float = 0.0) -> Delay:
    return lambda rng: base_s + rng.expovariate(1.0 / mean_s)


def constant(seconds: float) -> Delay:
    return lambda _: seconds


TEN_MS = exponential(0.010)


@dataclass
class Wire:
    """All parameters of a scenario; a scenario states only its differences from these."""

    up: Delay = TEN_MS
    down: Delay = TEN_MS
    drift: Callable[[float], float] = lambda _t: 0.0
    """Seconds by which the autopilot's clock has fallen behind after this time in seconds."""
    boot_start_s: float = 300.0
    requests_hz: Callable[[float], float] = lambda _t: 10.0
    seed: int = 1
    errors: list[tuple[float, float, ClockEstimate]] = field(default_factory=list)
    """(seconds, error in seconds, estimate), once a second."""

    def __post_init__(self) -> None:
        self.rng = random.Random(self.seed)
        self.clock = Clock()

    def host(self, t: float) -> HostNs:
        return HostNs(HOST_START_NS + round(t * 1e6) * 1000)

    def boot(self, t: float) -> BootNs:
        return BootNs(round((self.boot_start_s + t - self.drift(t)) * 1e6) * 1000)

    def true_offset_ns(self, t: float) -> float:
        return HOST_START_NS + (self.drift(t) - self.boot_start_s) * 1e9

    def exchange(self, t: float) -> ClockNews | None:
        """Send a request at t; returns what is news of the clock."""
        up, down = self.up(self.rng), self.down(self.rng)
        return self.clock.on_exchange(ClockExchange(self.host(t), self.host(t + up + down), self.boot(t + up)))

    def arrival(self, t: float) -> None:
        """A message, stamped in whole milliseconds at t, arrives."""
        stamp_ns = self.boot(t) // MS * MS
        self.clock.on_arrival(BootNs(stamp_ns), self.host(t + self.down(self.rng)))

    def error_s(self, t: float) -> tuple[float, ClockEstimate]:
        estimate = self.clock.estimate(self.host(t))
        return (estimate.host_from_autopilot_ns - self.true_offset_ns(t)) * 1e-9, estimate

    def run(self, until_s: float, *, from_s: float = 0.0) -> "Wire":
        """Send requests at their rate; each whole second the error is recorded and the bound must hold."""
        t, noted = from_s, int(from_s)
        while t < until_s:
            self.exchange(t)
            t += 1.0 / self.requests_hz(t)
            if t >= noted + 1:
                noted += 1
                # The result of an exchange is known at its end.
                error_s, estimate = self.error_s(t + 0.2)
                assert abs(error_s) <= estimate.bound_s, (t, error_s, estimate)
                self.errors.append((t, error_s, estimate))
        return self

    def worst_s(self, after_s: float) -> float:
        return max(abs(error) for t, error, _ in self.errors if t > after_s)
