"""The autopilot's clock as the smoother's: seconds that go on where a reboot starts the stamps again."""

from __future__ import annotations

from fwav_companion.geometry.stamps import NS_PER_S, BootNs, HostNs, s_from_ns

REBOOT_NS = NS_PER_S
"""Least time by which the autopilot's clock falls behind the host's at a reboot, ns: what a crystal or an estimate of
the clock changes is far less."""
MOST_BOOTS = 8
"""Boots that are remembered, for late frames of an earlier one."""


class FlightClock:
    """Adds to the stamps of each boot what its clock lacks by the host's."""

    __slots__ = ("_boots",)

    def __init__(self) -> None:
        self._boots: list[tuple[int, int]] = []
        """Of each boot: host's minus autopilot's clock at its newest frame, and what is added to its stamps, ns."""

    def follow(self, boot_ns: BootNs, host_ns: HostNs) -> tuple[int, bool]:
        """Take a frame's capture on both clocks: what is added to the stamps of its boot, ns, and whether the autopilot
        has rebooted since the frame before.
        """
        behind_ns, boots = host_ns - boot_ns, self._boots
        if not boots:
            boots.append((behind_ns, 0))
        last_ns, added_ns = boots[-1]
        if behind_ns - last_ns >= REBOOT_NS:
            boots.append((behind_ns, added_ns + behind_ns - last_ns))
            del boots[:-MOST_BOOTS]
            return boots[-1][1], True
        if last_ns - behind_ns >= REBOOT_NS:  # a late frame from before the reboot
            return min(boots, key=lambda boot: abs(boot[0] - behind_ns))[1], False
        boots[-1] = behind_ns, added_ns
        return added_ns, False

    def seconds(self, boot_ns: BootNs) -> float:
        """An instant of the present boot, s."""
        return s_from_ns(boot_ns + (self._boots[-1][1] if self._boots else 0))
