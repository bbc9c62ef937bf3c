"""From nothing to the first heartbeat on the wire: the CPU of the daemon against that of a Python that does nothing.

``python -m tests.benchmarks.startup``
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

from tests.benchmarks.figure import Figure

ROUNDS = 7
PATIENCE_S = 30.0


def _cpu_s(process: subprocess.Popen[bytes]) -> float:
    """CPU time of a child that has ended or is about to end, seconds."""
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return used.ru_utime + used.ru_stime


def _bare() -> float:
    return _cpu_s(subprocess.Popen([sys.executable, "-c", "pass"]))


def _daemon(folder: Path, station: socket.socket) -> float:
    """CPU time of a daemon that is killed as soon as its first heartbeat arrives, seconds."""
    command = [sys.executable, "-m", "fwav_companion", "run", "--config", "relay.toml"]
    process = subprocess.Popen(command, cwd=folder, stderr=subprocess.DEVNULL)
    station.recv(2048)
    process.send_signal(signal.SIGKILL)
    return _cpu_s(process)


def relay_configuration(station_port: int, autopilot_port: int = 0) -> str:
    """A configuration with links only. Everything is relayed: merging requests would hold back what only the service
    requested.
    """
    return (
        f'[[link]]\nname = "autopilot"\nurl = "udpin://127.0.0.1:{autopilot_port or 24597}"\nrole = "autopilot"\n'
        f'[[link]]\nname = "ground"\nurl = "udpout://127.0.0.1:{station_port}"\nrole = "gcs"\n'
        "forward_rate_requests = true\n"
        '[detections]\nurl = ""\n[status]\nfile = "status.json"\n'
    )


def measure() -> list[Figure]:
    """The ratio of CPU times in alternating rounds; the first round, which compiles files, does not count."""
    with tempfile.TemporaryDirectory() as name, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        station.settimeout(PATIENCE_S)
        (Path(name) / "relay.toml").write_text(relay_configuration(station.getsockname()[1]))
        pairs = [(_bare(), _daemon(Path(name), station)) for _ in range(ROUNDS + 1)][1:]
    bare_s, daemon_s = median(bare for bare, _ in pairs), median(daemon for _, daemon in pairs)
    detail = f"daemon {daemon_s * 1e3:.0f} ms, python -c pass {bare_s * 1e3:.0f} ms of CPU"
    return [Figure("start to the first heartbeat, against bare Python", daemon_s / bare_s, 25.0, False, detail)]


if __name__ == "__main__":
    print(*measure(), sep="\n")
