"""The autopilot's boot clock: boot = boot at start + (host - start) (1 + drift); a reboot starts it from zero.

In a simulator under load, vehicle and clock run together: slower than the host, and not at all in pauses.
"""

from __future__ import annotations

from collections.abc import Sequence


class SimulatorTime:
    """Time of a simulator against the host's, both from the start, nanoseconds."""

    def __init__(self, rate: float = 1.0, slips: Sequence[tuple[float, float]] = ()) -> None:
        """``slips``: (at, by) seconds of host time; the simulator pauses for ``by`` seconds."""
        self._rate = rate
        self._pauses = sorted((round(at_s * 1e9), round(by_s * 1e9)) for at_s, by_s in slips)

    def simulated_ns(self, host_ns: int) -> int:
        """Simulator's time at this time of the host."""
        running_ns = host_ns
        for at, by in self._pauses:
            running_ns -= max(0, min(by, host_ns - at))
        return running_ns if self._rate == 1.0 else round(running_ns * self._rate)

    def host_ns(self, simulated_ns: int) -> int:
        """First time of the host at which the simulator has reached this time."""
        host_ns = simulated_ns if self._rate == 1.0 else round(simulated_ns / self._rate)
        for at, by in self._pauses:
            if host_ns <= at:
                break
            host_ns += by
        return host_ns


class BootClock:
    """Boot clock; integer nanoseconds on both sides."""

    def __init__(
        self, start_host_ns: int, boot_at_start_ns: int, drift_ppm: float, time: SimulatorTime | None = None
    ) -> None:
        self._start = start_host_ns
        self._begun = 0
        self._boot0 = boot_at_start_ns
        self._drift = drift_ppm * 1e-6
        self._time = time or SimulatorTime()

    def boot_ns(self, host_ns: int) -> int:
        """Boot time at a host instant."""
        passed = self._time.simulated_ns(host_ns - self._start) - self._begun
        return self._boot0 + passed + round(passed * self._drift)

    def host_ns(self, boot_ns: int) -> int:
        """Host instant of a boot time (within the present boot)."""
        passed = boot_ns - self._boot0
        return self._start + self._time.host_ns(self._begun + round(passed / (1.0 + self._drift)))

    def reboot(self, host_ns: int) -> None:
        """Restarts the clock from zero."""
        self._begun, self._boot0 = self._time.simulated_ns(host_ns - self._start), 0
