"""The daemon as a separate process with the mock: memory, CPU, and the latency from a detection to its answer.

The mock sends attitudes at 100 Hz and thirty frames a second; everything is relayed to one ground station. The
benchmark sits between the two: a detection is timed from its transmission to the daemon until the kernel receives its
LANDING_TARGET, independent of when the benchmark reads it. The daemon has the priority of its systemd unit where
permissions allow it. ``python -m tests.benchmarks.daemon``
"""

from __future__ import annotations

import os
import select
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from statistics import quantiles
from typing import NamedTuple

from fwav_companion.mavlink.wire.scanner import Scanner
from tests.benchmarks.figure import Figure
from tests.benchmarks.startup import compiled, relay_configuration

SETTLING_S = 8.0
"""Adoption, rates and clock, and the first targets confirmed."""
MEASURED_S = 20.0
CPUCLOCK_SCHED = 2
"""Linux, posix-timers.h: with a process id, the id of that process's CPU clock. It counts nanoseconds; /proc counts
hundredths of a second, of which a bare loop uses a dozen in a measurement."""
IN_MEMORY = Path("/dev/shm")
"""Where the status is written, as on a board: /run is in memory. To replace a file on a disk costs as much as a tenth
of a relay."""
NICE = -5
"""Niceness in the systemd unit."""
SO_TIMESTAMPNS = 35
"""Linux, asm-generic/socket.h: a datagram carries its arrival time (CLOCK_REALTIME, a struct timespec); Python has no
name for the option."""
TIMESPEC = struct.Struct("@qq")
ANCILLARY_BYTES = socket.CMSG_SPACE(TIMESPEC.size)

CONFIGURATION = """
[camera]
calibration = "camera.yaml"
[detections]
url = "udpin://127.0.0.1:{detections}"
[tracking]
self_calibration = {calibrates}
[publish]
landing_target = true
landing_label = "target"
landing_max_sigma_m = 10.0
"""


TEN_TARGETS = """
import sys
from sitl_mock import TargetOptions, live, scenario
places = [(3.0 * (k % 4) - 4.5, 3.0 * (k // 4) - 3.0) for k in range(10)]
targets = tuple(TargetOptions(north=north, east=east) for north, east in places)
camera = {"camera.missed": 0.0, "camera.clutter": 0.0, "camera.latency_s": float(sys.argv[3])}
changes = {"targets": targets, "seconds": 600.0, **camera}
live.run(scenario("default").but(changes), live.Plan(sys.argv[1], sys.argv[2]), lambda: False, lambda _: None)
"""
"""A detector with ten targets in view, which sends each frame at a given delay after its last row."""
BARE = """
import asyncio, socket, sys
heard, station = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
heard.bind(("127.0.0.1", int(sys.argv[1])))
heard.setblocking(False)
station.connect(("127.0.0.1", int(sys.argv[2])))
async def main():
    asyncio.get_running_loop().add_reader(heard, lambda: station.send(heard.recv(65536)))
    await asyncio.Event().wait()
asyncio.run(main())
"""
"""A process that forwards each datagram of the autopilot to a station and does nothing else: the cost of waking up on
this machine, with the caches as other processes leave them. The daemon forwards the same ones. By itself it also sends
ten TIMESYNC requests a second in the first half minute, heartbeats and requests for rates, and writes the status."""
EARLY_S, LATE_S = 0.03, 0.05
"""Delays after the last row, seconds. The benchmark covers everything between a detection and its answer, with the
mock's own detector. A frame at EARLY_S may wait for the second attitude after its capture, which at 100 Hz takes up
to 20 ms to be made and a few to arrive; at LATE_S, as with marker detection on a small board, no frame waits, and
the time is our processing alone."""


class Usage(NamedTuple):
    """Resources of one process during the measurement."""

    cpu: float
    """Share of one core."""
    wakes_hz: float
    """Wake-ups a second of all its threads: the voluntary context switches that the kernel counts."""


class Work(NamedTuple):
    """The measurement of one flight."""

    rss_mib: float
    daemon: Usage
    bare: Usage
    """A process that only forwards the same datagrams of the autopilot, at the same time."""
    latencies_s: list[float]

    @property
    def ratio(self) -> float:
        """CPU of the daemon in that of the bare loop."""
        return self.daemon.cpu / self.bare.cpu

    def __str__(self) -> str:
        daemon, bare = self.daemon, self.bare
        return (
            f"{100.0 * daemon.cpu:.1f} % of a core, {daemon.wakes_hz:.0f} wake-ups/s; a bare event loop for the"
            f" autopilot's datagrams {100.0 * bare.cpu:.1f} %, {bare.wakes_hz:.0f}/s"
        )


class Between:
    """Sockets between the mock and the daemon, and a ground station that does not read: a real one is another machine's
    work.
    """

    def __init__(self) -> None:
        self.sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(4)]
        for sock in self.sockets:
            sock.bind(("127.0.0.1", 0))
        self.mock, self.frames, self.daemon, self.station = self.sockets
        self.daemon.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self.vehicle: tuple[str, int] | None = None
        self.bare: tuple[str, int] | None = None
        """Address of the process that only forwards the autopilot's datagrams, in parallel with the daemon."""
        self.scanner = Scanner(datagrams=True)
        self.frame_sent_s: float | None = None
        """Transmission time of the newest frame to the daemon, Unix seconds; None once it was answered."""
        self.latencies_s: list[float] = []

    def port(self, sock: socket.socket) -> int:
        port: int = sock.getsockname()[1]
        return port

    def carry(self, autopilot: tuple[str, int], detections: tuple[str, int], seconds: float) -> None:
        """Forward everything in both directions for the given time."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0.0:
            for ready in select.select(self.sockets[:3], [], [], left)[0]:
                data, reported, _, address = ready.recvmsg(65536, ANCILLARY_BYTES)
                if ready is self.frames:
                    self.frame_sent_s = time.time()
                    self.frames.sendto(data, detections)
                elif ready is self.mock:
                    self.vehicle = address
                    self.daemon.sendto(data, autopilot)
                    if self.bare is not None:
                        self.station.sendto(data, self.bare)
                elif ready is self.daemon:
                    seconds_came, ns_came = TIMESPEC.unpack(reported[0][2])
                    self._answered(data, seconds_came + ns_came * 1e-9)
                    if self.vehicle is not None:
                        self.mock.sendto(data, self.vehicle)

    def _answered(self, data: bytes, came_unix_s: float) -> None:
        for frame in self.scanner.feed(data):
            if frame.definition is None or frame.definition.name != "LANDING_TARGET":
                continue
            # Each frame has one message, whose time is that of a prediction: the newest frame is the answered one.
            if self.frame_sent_s is not None:
                self.latencies_s.append(came_unix_s - self.frame_sent_s)
                self.frame_sent_s = None


@contextmanager
def child(*command: str, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A child process that is killed when the block ends."""
    process = subprocess.Popen(
        [sys.executable, *command],
        cwd=folder,
        env=compiled(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def cpu_s(pid: int) -> float:
    """CPU time of a process since its start, seconds."""
    return time.clock_gettime(~pid << 3 | CPUCLOCK_SCHED)


def wakes(pid: int) -> int:
    """Voluntary context switches of all threads of a process since its start."""
    return sum(
        int((task / "status").read_text().partition("\nvoluntary_ctxt_switches:")[2].split()[0])
        for task in Path(f"/proc/{pid}/task").iterdir()
    )


def rss_mib(pid: int) -> float:
    """Current resident memory of a process, MiB."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        port: int = sock.getsockname()[1]
        return port


RUN = ("-m", "fwav_companion", "run", "--config", "flight.toml")


def watch(
    *, camera: bool = True, calibrates: bool = False, ten_sent_after_s: float | None = None,
    daemon_command: tuple[str, ...] = RUN,
) -> Work:  # fmt: skip
    """One flight; with ``ten_sent_after_s``, ten targets whose frames are sent at this delay after the last row."""
    autopilot, detections = ("127.0.0.1", free_port()), ("127.0.0.1", free_port())
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(dir=IN_MEMORY if IN_MEMORY.is_dir() else None)))
        between = Between()
        for sock in between.sockets:
            stack.enter_context(sock)
        text = relay_configuration(between.port(between.station), autopilot[1])
        if camera:
            subprocess.run([sys.executable, "-m", "fwav_companion", "init", "made"], cwd=folder, check=True,
                           stdout=subprocess.DEVNULL)  # fmt: skip
            (folder / "camera.yaml").write_bytes((folder / "made/camera.yaml").read_bytes())
            reported = CONFIGURATION.format(detections=detections[1], calibrates=str(calibrates).lower())
            text = text.replace('[detections]\nurl = ""\n', reported)
        (folder / "flight.toml").write_text(text)
        daemon = stack.enter_context(child(*daemon_command, folder=folder))
        with suppress(PermissionError):
            os.setpriority(os.PRIO_PROCESS, daemon.pid, NICE)
        url = f"udpout:127.0.0.1:{between.port(between.mock)}"
        looks = f"127.0.0.1:{between.port(between.frames)}" if camera else ""
        one = ("-m", "sitl_mock", "--connect", url, "--detections", looks, "--seconds", "600")
        ten = ("-c", TEN_TARGETS, url, looks, str(ten_sent_after_s))
        stack.enter_context(child(*(one if ten_sent_after_s is None else ten), folder=folder))
        between.bare = ("127.0.0.1", free_port())
        ports = (str(between.bare[1]), str(between.port(between.station)))
        watched = [daemon.pid, stack.enter_context(child("-c", BARE, *ports, folder=folder)).pid]
        between.carry(autopilot, detections, SETTLING_S)
        between.latencies_s.clear()
        before, began_s = [(cpu_s(pid), wakes(pid)) for pid in watched], time.monotonic()
        between.carry(autopilot, detections, MEASURED_S)
        elapsed_s = time.monotonic() - began_s
        ours, bare = (
            Usage((cpu_s(pid) - cpu) / elapsed_s, (wakes(pid) - woken) / elapsed_s)
            for pid, (cpu, woken) in zip(watched, before, strict=True)
        )
        return Work(rss_mib(daemon.pid), ours, bare, between.latencies_s)


def answered(sent_after_s: float, name: str) -> Figure:
    """The 98th percentile of the latency of answers, with ten detections in each frame."""
    latencies_s = watch(ten_sent_after_s=sent_after_s).latencies_s
    if len(latencies_s) < MEASURED_S:
        raise AssertionError("no landing target came back")
    cuts_s = quantiles(latencies_s, n=100)
    found = f"median {cuts_s[49] * 1e3:.2f} ms, of {len(latencies_s)} frames; 10 detections each"
    return Figure(name, cuts_s[98] * 1e3, 2.0, False, f"{found}, sent {sent_after_s * 1e3:.0f} ms after the last row")


def measure() -> list[Figure]:
    """Five flights, about two and a half minutes."""
    relay = watch(camera=False)
    plain = watch()
    calibrating = watch(calibrates=True)
    conditions = "100 Hz attitude, 30 frames/s, one relay"
    return [
        answered(EARLY_S, "detection in to MAVLink out, p99, ms"),
        answered(LATE_S, "the same where no frame waits for attitudes, p99, ms"),
        Figure("pure relay: CPU in that of a bare loop", relay.ratio, 2.5, False, str(relay)),
        Figure("pure relay: memory, MiB", relay.rss_mib, 32.0, False, conditions),
        Figure("daemon with one target: CPU in that of a bare loop", plain.ratio, 4.0, False, str(plain)),
        Figure("daemon with one target: memory, MiB", plain.rss_mib, 40.0, False, conditions),
        Figure("the same with self-calibration: CPU", calibrating.ratio, 5.0, False, str(calibrating)),
        Figure("the same with self-calibration: memory, MiB", calibrating.rss_mib, 54.0, False, conditions),
    ]


if __name__ == "__main__":
    print(*measure(), sep="\n")
