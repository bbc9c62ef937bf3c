"""INS_GYRO_FILTER: the two-pole low-pass filter of the autopilot's body rates."""

from __future__ import annotations

from collections import deque
from math import cos, pi, tan

from sitl_mock.flight import Flight
from sitl_mock.rotation import Vector

SAMPLE_HZ = 1000.0
"""Sample rate of a common gyro; the filter runs on each sample."""
KEPT_S = 0.5
"""Age of the oldest output that is kept, seconds."""
SETTLING_S = 0.3
"""Settling time before the first requested instant, seconds: many time constants of any filter in use."""


class TwoPole:
    """Butterworth low-pass of one axis: bilinear transform with the cut-off prewarped, as in autopilots."""

    __slots__ = ("_a1", "_a2", "_b0", "_d1", "_d2")

    def __init__(self, cutoff_hz: float, sample_hz: float) -> None:
        ohm = tan(pi * cutoff_hz / sample_hz)
        c = 1.0 + 2.0 * cos(pi / 4.0) * ohm + ohm * ohm
        self._b0 = ohm * ohm / c
        self._a1 = 2.0 * (ohm * ohm - 1.0) / c
        self._a2 = (1.0 - 2.0 * cos(pi / 4.0) * ohm + ohm * ohm) / c
        self._d1 = self._d2 = 0.0

    def start_at(self, value: float) -> None:
        """Sets the steady state of a constant input."""
        self._d1 = self._d2 = value / (1.0 + self._a1 + self._a2)

    def step(self, value: float) -> float:
        """Filters one sample."""
        d1, d2 = self._d1, self._d2
        d0 = value - self._a1 * d1 - self._a2 * d2
        self._d2, self._d1 = d1, d0
        return self._b0 * (d0 + 2.0 * d1 + d2)


class Gyro:
    """Filtered body rates of a flight, for instants in mostly ascending order."""

    def __init__(self, flight: Flight, cutoff_hz: float) -> None:
        self._flight = flight
        self._cutoff_hz = cutoff_hz
        self._outputs: deque[Vector] = deque(maxlen=int(KEPT_S * SAMPLE_HZ))
        self._next = 0
        self._filters: list[TwoPole] = []

    def rates(self, flight_s: float) -> Vector:
        """Filtered body rates (p, q, r) at an instant, rad/s."""
        if self._cutoff_hz <= 0.0:
            return self._flight.rates(flight_s)
        index = flight_s * SAMPLE_HZ
        whole = int(index // 1)
        if not self._filters or whole - self._next > KEPT_S * SAMPLE_HZ:
            self._restart(whole - int(SETTLING_S * SAMPLE_HZ))
        while self._next <= whole + 1:
            self._step()
        first = self._next - len(self._outputs)
        whole = max(whole, first)
        before, after = self._outputs[whole - first], self._outputs[whole + 1 - first]
        share = min(1.0, max(0.0, index - whole))
        return tuple(a + share * (b - a) for a, b in zip(before, after, strict=True))  # type: ignore[return-value]

    def _restart(self, index: int) -> None:
        self._outputs.clear()
        self._next = index
        self._filters = [TwoPole(self._cutoff_hz, SAMPLE_HZ) for _ in range(3)]
        for one, value in zip(self._filters, self._flight.rates(index / SAMPLE_HZ), strict=True):
            one.start_at(value)

    def _step(self) -> None:
        p, q, r = self._flight.rates(self._next / SAMPLE_HZ)
        x, y, z = self._filters
        self._outputs.append((x.step(p), y.step(q), z.step(r)))
        self._next += 1
