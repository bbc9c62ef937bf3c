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
import time
from pathlib import Path
from statistics import median

from tests.benchmarks.figure import Figure

ROUNDS = 7
PATIENCE_S = 30.0
CONSOLE_SCRIPT = """
import re, sys
sys.argv = ["fwav-companion", "run", "--config", "absent.toml"]
from fwav_companion.__main__ import main
sys.exit(main())
"""
"""As pip writes it."""


def _cpu_s(process: subprocess.Popen[bytes]) -> float:
    """CPU time of a child that has ended or is about to end, seconds."""
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return used.ru_utime + used.ru_stime


def compiled() -> dict[str, str]:
    """Environment of a process that loads compiled files, as from an installed package, also where this one may not
    write them: compiling takes as long as the rest of the start, and 1 MiB.
    """
    return {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def _bare() -> float:
    return _cpu_s(subprocess.Popen([sys.executable, "-c", "pass"], env=compiled()))


def _daemon(folder: Path, station: socket.socket, config: str) -> float:
    """CPU time of a daemon that is killed as soon as its first heartbeat arrives, seconds."""
    command = [sys.executable, "-m", "fwav_companion", "run", "--config", config]
    process = subprocess.Popen(command, cwd=folder, stderr=subprocess.DEVNULL, env=compiled())
    station.recv(2048)
    process.send_signal(signal.SIGKILL)
    return _cpu_s(process)


def _until_handled() -> float:
    """CPU time of a start until the kernel reports SIGTERM as caught, by the scheduler's account, seconds."""
    process = subprocess.Popen([sys.executable, "-c", CONSOLE_SCRIPT], stderr=subprocess.DEVNULL, env=compiled())
    proc = Path("/proc") / str(process.pid)
    try:
        while not _catches(proc, signal.SIGTERM):
            if process.poll() is not None:
                raise RuntimeError("the daemon ended before it handled stop signals")
            time.sleep(0.0002)
        return int((proc / "schedstat").read_text().split()[0]) * 1e-9
    finally:
        process.kill()
        process.wait()


def _catches(proc: Path, number: int) -> bool:
    caught = int((proc / "status").read_text().partition("SigCgt:")[2].split()[0], 16)
    return bool(caught >> (number - 1) & 1)


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
        folder, port = Path(name), station.getsockname()[1]
        made = [sys.executable, "-m", "fwav_companion", "init", "made"]
        subprocess.run(made, cwd=folder, check=True, stdout=subprocess.DEVNULL)
        (folder / "relay.toml").write_text(relay_configuration(port))
        camera = relay_configuration(port).replace('url = ""', 'url = "unix:///tmp/fwav-benchmark"')
        camera += '[camera]\ncalibration = "made/camera.yaml"\n'
        (folder / "camera.toml").write_text(camera)
        (folder / "calibrating.toml").write_text(f"{camera}[tracking]\nself_calibration = true\n")
        works = (("relay.toml", "a relay", 15.0), ("camera.toml", "with a camera", 15.0),
                 ("calibrating.toml", "with self-calibration (numpy)", 25.0))  # fmt: skip
        rounds = [
            (_bare(), _until_handled(), *(_daemon(folder, station, config) for config, _, _ in works))
            for _ in range(ROUNDS + 1)
        ]
    bare_s, handled_s, *daemons_s = (median(each) for each in zip(*rounds[1:], strict=True))
    return [
        Figure("start until stop signals are handled, against bare Python", handled_s / bare_s, 2.0, False,
               f"{handled_s * 1e3:.0f} ms, python -c pass {bare_s * 1e3:.0f} ms of CPU"),
        *(Figure(f"start to the first heartbeat, {name}, against bare Python", spent_s / bare_s, budget, False,
               f"{spent_s * 1e3:.0f} ms, python -c pass {bare_s * 1e3:.0f} ms of CPU")
          for spent_s, (_, name, budget) in zip(daemons_s, works, strict=True)),
    ]  # fmt: skip


if __name__ == "__main__":
    print(*measure(), sep="\n")
