"""The autopilot's boot clock: boot = boot at start + (host - start) (1 + drift); a reboot starts it from zero."""

from __future__ import annotations


class BootClock:
    """Boot clock; integer nanoseconds on both sides."""

    def __init__(self, start_host_ns: int, boot_at_start_ns: int, drift_ppm: float) -> None:
        self._host0 = start_host_ns
        self._boot0 = boot_at_start_ns
        self._drift = drift_ppm * 1e-6

    def boot_ns(self, host_ns: int) -> int:
        """Boot time at a host instant."""
        passed = host_ns - self._host0
        return self._boot0 + passed + round(passed * self._drift)

    def host_ns(self, boot_ns: int) -> int:
        """Host instant of a boot time (within the present boot)."""
        passed = boot_ns - self._boot0
        return self._host0 + round(passed / (1.0 + self._drift))

    def reboot(self, host_ns: int) -> None:
        """Restarts the clock from zero."""
        self._host0, self._boot0 = host_ns, 0
