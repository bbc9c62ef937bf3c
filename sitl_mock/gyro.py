"""INS_GYRO_FILTER: the two-pole low-pass filter of the autopilot's body rates."""

from __future__ import annotations

from collections import deque
from math import cos, pi, tan

from sitl_mock.flight import Flight
from sitl_mock.rotation import Vector

SAMPLE_HZ = 500.0
"""Samples that the filter takes a second. Gyros of autopilots give 1000 and more; by the prewarped transform the filter
is the same to 1 % of its phase up to the cut-off with half of them, which cost half."""
KEPT_S = 0.5
"""Age of the oldest output that is kept, seconds."""
SETTLING_S = 0.3
"""Settling time before the first requested instant, seconds: many time constants of any filter in use."""


class TwoPole:
    """Butterworth low-pass of three axes: bilinear transform with the cut-off prewarped, as in autopilots."""

    __slots__ = ("_coefficients", "_delayed")

    def __init__(self, cutoff_hz: float, sample_hz: float) -> None:
        ohm = tan(pi * cutoff_hz / sample_hz)
        c = 1.0 + 2.0 * cos(pi / 4.0) * ohm + ohm * ohm
        self._coefficients = (
            2.0 * (ohm * ohm - 1.0) / c,
            (1.0 - 2.0 * cos(pi / 4.0) * ohm + ohm * ohm) / c,
            ohm * ohm / c,
        )
        self._delayed: tuple[Vector, Vector] = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)

    def start_at(self, values: Vector) -> None:
        """Sets the steady state of a constant input."""
        a1, a2, _ = self._coefficients
        x, y, z = values
        steady = x / (1.0 + a1 + a2), y / (1.0 + a1 + a2), z / (1.0 + a1 + a2)
        self._delayed = steady, steady

    def step(self, values: Vector) -> Vector:
        """Filters one sample. Unrolled, because it runs a thousand times a second."""
        a1, a2, b0 = self._coefficients
        x, y, z = values
        before, (x2, y2, z2) = self._delayed
        x1, y1, z1 = before
        x0, y0, z0 = x - a1 * x1 - a2 * x2, y - a1 * y1 - a2 * y2, z - a1 * z1 - a2 * z2
        self._delayed = (x0, y0, z0), before
        return b0 * (x0 + 2.0 * x1 + x2), b0 * (y0 + 2.0 * y1 + y2), b0 * (z0 + 2.0 * z1 + z2)


class Gyro:
    """Filtered body rates of a flight, for instants in mostly ascending order."""

    def __init__(self, flight: Flight, cutoff_hz: float, sample_hz: float = SAMPLE_HZ) -> None:
        self._flight = flight
        self._cutoff_hz, self._sample_hz = cutoff_hz, sample_hz
        self._outputs: deque[Vector] = deque(maxlen=max(2, int(KEPT_S * sample_hz)))
        self._next = 0
        self._filter: TwoPole | None = None

    def rates(self, flight_s: float) -> Vector:
        """Filtered body rates (p, q, r) at an instant, rad/s."""
        if self._cutoff_hz <= 0.0:
            return self._flight.rates(flight_s)
        index = flight_s * self._sample_hz
        whole = int(index // 1)
        if self._filter is None or whole - self._next > KEPT_S * self._sample_hz:
            self._filter = self._restarted(whole - int(SETTLING_S * self._sample_hz))
        rates, step, keep = self._flight.rates, self._filter.step, self._outputs.append
        sample_hz = self._sample_hz
        for number in range(self._next, whole + 2):
            keep(step(rates(number / sample_hz)))
        self._next = max(self._next, whole + 2)
        first = self._next - len(self._outputs)
        whole = max(whole, first)
        before, after = self._outputs[whole - first], self._outputs[whole + 1 - first]
        share = min(1.0, max(0.0, index - whole))
        return tuple(a + share * (b - a) for a, b in zip(before, after, strict=True))  # type: ignore[return-value]

    def _restarted(self, index: int) -> TwoPole:
        self._outputs.clear()
        self._next = index
        restarted = TwoPole(self._cutoff_hz, self._sample_hz)
        restarted.start_at(self._flight.rates(index / self._sample_hz))
        return restarted
