"""SHELL: the board of this process: its load, its name, and whether its wall clock is synchronised."""

from __future__ import annotations

import socket
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path

from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.types.board import BoardReport, LinkLoad
from fwav_companion.types.network_status import LinkReport

NAME_LENGTH = 12
"""Length of a board's name in hexadecimal digits: enough to distinguish the boards of one operation."""
TIME_ERROR = 5
"""Return value of adjtimex(2) while the clock is not synchronised."""
TIMEX_BYTES = 256
"""An upper bound of the size of struct timex."""


def board_name(machine_id: Path = Path("/etc/machine-id")) -> str:
    """A name that is the same after a restart: a hash, because machine-id(5) asks to keep the id itself private."""
    try:
        secret = machine_id.read_text().strip()
    except (OSError, UnicodeDecodeError):
        secret = ""
    return sha256(f"fwav-companion {secret or socket.gethostname()}".encode()).hexdigest()[:NAME_LENGTH]


def wall_clock_is_synchronised() -> bool:
    """Whether the kernel's flag is set, as by NTP daemons (adjtimex(2) without an adjustment needs no privilege)."""
    import ctypes  # needed only where Cursor on Target is sent

    try:
        state: int = ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(TIMEX_BYTES))
    except (OSError, AttributeError):
        return False
    return 0 <= state < TIME_ERROR


class BoardWatch:
    """Measures the load since the previous report."""

    def __init__(self, serial: Mapping[str, bool], proc: Path = Path("/proc"), sys: Path = Path("/sys")) -> None:
        """``serial``: whether a link is a serial line, by name of the link."""
        self._serial = serial
        self._proc = proc
        self._celsius = sys / "class/thermal/thermal_zone0/temp"
        self._ticks: list[tuple[int, int]] = []
        self._bytes: dict[str, tuple[int, int]] = {}
        self._taken_ns: HostNs | None = None

    def report(self, links: Mapping[str, LinkReport], utc_minus_host_s: float | None, now: HostNs) -> BoardReport:
        """The load since the previous report. ``links``: their status by name."""
        ram_total_mib, ram_used_mib = self._ram()
        return BoardReport(
            cpu=self._cpu(),
            ram_used_mib=ram_used_mib,
            ram_total_mib=ram_total_mib,
            core_celsius=self._core_celsius(),
            links=self._loads(links, now),
            utc_minus_host_s=utc_minus_host_s,
        )

    def _cpu(self) -> tuple[float, ...]:
        """Load of each core, from /proc/stat, proc(5): user, nice, system, idle, iowait, irq, softirq, steal."""
        ticks = []
        for line in _text(self._proc / "stat").splitlines():
            name, *numbers = line.split()
            if name.startswith("cpu") and name != "cpu" and len(numbers) >= 5:
                counts = [int(number) for number in numbers[:8]]
                ticks.append((sum(counts), counts[3] + counts[4]))
        before, self._ticks = self._ticks, ticks
        if len(before) != len(ticks):
            return ()
        return tuple(
            1.0 - (idle - idle_before) / (total - total_before) if total > total_before else 0.0
            for (total, idle), (total_before, idle_before) in zip(ticks, before, strict=True)
        )

    def _ram(self) -> tuple[int | None, int | None]:
        kib = {}
        for line in _text(self._proc / "meminfo").splitlines():
            name, _, value = line.partition(":")
            if name in {"MemTotal", "MemAvailable"}:
                kib[name] = int(value.split()[0])
        if len(kib) < 2:
            return None, None
        return kib["MemTotal"] // 1024, (kib["MemTotal"] - kib["MemAvailable"]) // 1024

    def _core_celsius(self) -> float | None:
        milli = _text(self._celsius).strip()
        return int(milli) / 1000.0 if milli.removeprefix("-").isdecimal() else None

    def _loads(self, links: Mapping[str, LinkReport], now: HostNs) -> tuple[LinkLoad, ...]:
        elapsed_s = 0.0 if self._taken_ns is None else s_from_ns(now - self._taken_ns)
        loads = []
        for name, link in links.items():
            counts = (link.bytes_out, link.bytes_in)
            sent, received = self._bytes.get(name, counts)
            self._bytes[name] = counts
            if elapsed_s > 0.0:
                scale = 1.0 / (1024.0 * elapsed_s)
                loads.append(
                    LinkLoad(self._serial.get(name, False), (counts[0] - sent) * scale, (counts[1] - received) * scale)
                )
        self._taken_ns = now
        return tuple(loads)


def _text(path: Path) -> str:
    """Text of a file of the kernel; "" where the file does not exist."""
    try:
        return path.read_text()
    except (OSError, UnicodeDecodeError):
        return ""
