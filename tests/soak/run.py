"""An hour at full rates: memory, descriptors, clock and accuracy at the end as at the start.

``python tests/soak/run.py --seconds 3600``. Ten targets at 30 frames/s, attitudes at 100 Hz, self-calibration and a
recording; a client of a TCP link and one of a UDP link come and go each second, and one in ten leaves without a word.
The mock and the daemon are processes of their own. Every ten seconds one line has memory, descriptors, threads, the
sigma of the clock and the errors of the targets in the recording; the last line has the verdict, and the exit status is
1 if it fails.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from fwav_companion.cli.main import main as command

SETTLING_SHARE = 1 / 6
"""Share of the time before the first sample that counts: ten minutes of an hour."""
SAMPLE_S = 10.0
MOST_SLOPE_MIB_H = 0.5
MOST_ERROR_RATIO = 2.0
"""Median error of the targets at the end, in that at the start; both are a few centimetres, of one draw of biases."""
MOST_CLOCK_SIGMA_S = 0.002
M_PER_DEGREE = 111_320.0
TEN_TARGETS = """
import sys
from sitl_mock import TargetOptions, live, scenario
places = [(3.0 * (k % 4) - 4.5, 3.0 * (k // 4) - 3.0) for k in range(10)]
targets = tuple(TargetOptions(label=f"t{k}", north=north, east=east) for k, (north, east) in enumerate(places))
changes = {"targets": targets, "seconds": float(sys.argv[3]), "seed": int(sys.argv[4])}
plan = live.Plan(sys.argv[1], sys.argv[2], truth="truth.jsonl")
live.run(scenario("figure_eight").but(changes), plan, lambda: False, lambda _: None)
"""


class Sample(NamedTuple):
    """State of the daemon at one instant."""

    at_s: float
    rss_mib: float
    descriptors: int
    threads: int
    clock_sigma_s: float | None
    errors_m: tuple[float, ...]
    """Distance of each confirmed target from the nearest true one, by the newest lines of the recording."""


def main(words: Sequence[str] | None = None) -> int:
    """Run the soak, and print the samples and the verdict."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=3600.0)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args(words)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        samples, status = _fly(stack, folder, arguments.seconds, arguments.seed)
    failures = verdict(samples, arguments.seconds) + ([f"exit status {status}"] if status else [])
    print("; ".join(failures) or f"passed: {arguments.seconds:.0f} s, seed {arguments.seed}")
    return 1 if failures else 0


def _fly(stack: ExitStack, folder: Path, seconds: float, seed: int) -> tuple[list[Sample], int]:
    clients = Clients(seed)
    autopilot, detections, tcp, udp = (_free_port() for _ in range(4))
    _configure(folder, autopilot, detections, tcp=tcp, udp=udp)
    daemon = stack.enter_context(_child(folder, "-m", "fwav_companion", "run", "--config", "fwav-companion.toml"))
    url, frames = f"udpout:127.0.0.1:{autopilot}", f"127.0.0.1:{detections}"
    stack.enter_context(_child(folder, "-c", TEN_TARGETS, url, frames, str(seconds + 30.0), str(seed)))
    samples: list[Sample] = []
    began_s, beat = time.monotonic(), 0
    while (now_s := time.monotonic() - began_s) < seconds:
        clients.come_and_go(tcp, udp)
        if now_s >= SAMPLE_S * (len(samples) + 1):
            samples.append(_sample(now_s, daemon.pid, folder))
            print(_line(samples[-1]), flush=True)
        beat += 1
        time.sleep(max(0.0, began_s + beat - time.monotonic()))
    clients.close()
    daemon.send_signal(signal.SIGTERM)
    return samples, daemon.wait(20.0)


def verdict(samples: Sequence[Sample], seconds: float) -> list[str]:
    """Return what is not as it was at the start."""
    counted = [sample for sample in samples if sample.at_s >= SETTLING_SHARE * seconds]
    if len(counted) < 4:
        return ["too short to judge: a minute at least"]
    failures = []
    slope, sigma = _slope_mib_h(counted)
    print(f"memory: {slope:+.2f} MiB/h, one sigma {sigma:.2f}; {counted[-1].rss_mib:.1f} MiB")
    if slope > MOST_SLOPE_MIB_H + 2.0 * sigma:
        failures.append(f"memory grows by {slope:.2f} MiB/h")
    first, last = counted[: len(counted) // 3], counted[-(len(counted) // 3) :]
    if min(sample.descriptors for sample in last) > max(sample.descriptors for sample in first):
        failures.append(f"descriptors: {first[0].descriptors} at the start, {last[-1].descriptors} at the end")
    if min(sample.threads for sample in last) > max(sample.threads for sample in first):
        failures.append(f"threads: {first[0].threads} at the start, {last[-1].threads} at the end")
    sigmas = [sample.clock_sigma_s for sample in last]
    if any(sigma is None or sigma > MOST_CLOCK_SIGMA_S for sigma in sigmas):
        failures.append(f"clock: {sigmas}")
    before, after = (_median_error(part) for part in (first, last))
    print(f"median error of targets: {before:.3f} m at the start, {after:.3f} m at the end")
    if not after <= MOST_ERROR_RATIO * before + 0.02 or any(len(sample.errors_m) < 10 for sample in last):
        failures.append(f"targets: {before:.3f} m at the start, {after:.3f} m and {len(last[-1].errors_m)} at the end")
    return failures


class Clients:
    """Ground stations that connect, greet and leave: one by TCP and one by UDP each second."""

    def __init__(self, seed: int) -> None:
        self._rng = random.Random(seed)
        self._left: list[socket.socket] = []
        """Clients that fell silent without closing, the newest."""

    def come_and_go(self, tcp: int, udp: int) -> None:
        """Let one client of each kind come, hear something, and leave."""
        from pymavlink.dialects.v20 import ardupilotmega as dialect

        mav = dialect.MAVLink(None, srcSystem=self._rng.randrange(200, 255), srcComponent=190)
        greeting = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(mav)
        for kind, port in ((socket.SOCK_STREAM, tcp), (socket.SOCK_DGRAM, udp)):
            client = socket.socket(socket.AF_INET, kind)
            client.settimeout(0.05)
            with suppress(OSError):
                client.connect(("127.0.0.1", port))
                client.send(greeting)
                client.recv(65536)
            if self._rng.random() < 0.1:
                self._left = [*self._left, client][-20:]
            else:
                client.close()

    def close(self) -> None:
        """Close those that fell silent."""
        for client in self._left:
            client.close()


def _configure(folder: Path, autopilot: int, detections: int, *, tcp: int, udp: int) -> None:
    if command(["init", str(folder)]):
        raise RuntimeError("init failed")
    path = folder / "fwav-companion.toml"
    text = path.read_text()
    for old, new in (
        ('"serial:///dev/serial0:921600"', f'"udpin://127.0.0.1:{autopilot}"'),
        ("udpout://127.0.0.1:14550", f"udpin://127.0.0.1:{udp}"),
        ("udpin://127.0.0.1:14601", f"udpin://127.0.0.1:{detections}"),
        ('\nfile = ""', f'\nfile = "{folder}/status.json"'),
        ('directory = ""                # "" records', f'directory = "{folder}/records"  # "" records'),
        ("self_calibration = false", "self_calibration = true"),
    ):
        if old not in text:
            raise RuntimeError(f"init's configuration has no {old}")
        text = text.replace(old, new, 1)
    path.write_text(f'{text}\n[[link]]\nname = "clients"\nurl = "tcpin://127.0.0.1:{tcp}"\nrole = "gcs"\n')


def _sample(at_s: float, pid: int, folder: Path) -> Sample:
    proc = Path("/proc") / str(pid)
    status: dict[str, Any] = {}
    with suppress(OSError, msgspec.DecodeError):
        status = json.loads((folder / "status.json").read_bytes())
    return Sample(
        at_s,
        int((proc / "statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20,
        len(list((proc / "fd").iterdir())),
        len(list((proc / "task").iterdir())),
        status.get("clock", {}).get("sigma_s"),
        tuple(_errors_m(folder)),
    )


def _errors_m(folder: Path) -> Iterator[float]:
    """Yield the distance of each target that is confirmed now from the nearest true one."""
    targets = _truth(folder)
    newest: dict[int, dict[str, Any]] = {}
    for line in _last_lines(folder):
        if line.get("type") == "target":
            newest[line["track"]] = line
    for line in newest.values():
        if line["state"] in {"confirmed", "coasting"} and line["lat"] is not None and targets:
            yield min(_distance_m(line, target) for target in targets)


def _truth(folder: Path) -> list[dict[str, Any]]:
    with suppress(OSError, IndexError, json.JSONDecodeError, KeyError):
        with (folder / "truth.jsonl").open() as file:
            targets: list[dict[str, Any]] = json.loads(file.readline())["targets"]
        return targets
    return []


def _last_lines(folder: Path) -> Iterator[dict[str, Any]]:
    """Yield the lines of the last two seconds or so of the recording."""
    files = sorted((folder / "records").glob("*/targets.jsonl"))
    if not files:
        return
    with files[-1].open("rb") as file:
        file.seek(max(0, files[-1].stat().st_size - 600_000))
        for line in file.read().split(b"\n")[1:-1]:
            yield json.loads(line)


def _distance_m(line: dict[str, Any], target: dict[str, Any]) -> float:
    north = (line["lat"] - target["lat"]) * M_PER_DEGREE
    return math.hypot(north, (line["lon"] - target["lon"]) * M_PER_DEGREE * math.cos(math.radians(target["lat"])))


def _slope_mib_h(samples: Sequence[Sample]) -> tuple[float, float]:
    """Return the slope of memory by least squares, and its sigma by the residuals."""
    times, sizes = [sample.at_s / 3600.0 for sample in samples], [sample.rss_mib for sample in samples]
    fit = statistics.linear_regression(times, sizes)
    residuals = [size - fit.intercept - fit.slope * at_h for at_h, size in zip(times, sizes, strict=True)]
    spread = statistics.pstdev(times) * math.sqrt(len(times))
    return fit.slope, math.sqrt(sum(each * each for each in residuals) / (len(times) - 2)) / spread


def _median_error(samples: Sequence[Sample]) -> float:
    return statistics.median([error for sample in samples for error in sample.errors_m] or [math.inf])


def _line(sample: Sample) -> str:
    errors = f"{len(sample.errors_m)} targets"
    if sample.errors_m:
        errors += f", median error {statistics.median(sample.errors_m):.3f} m"
    clock = "no clock" if sample.clock_sigma_s is None else f"clock {sample.clock_sigma_s * 1e3:.2f} ms"
    return (
        f"{sample.at_s:6.0f} s: {sample.rss_mib:.2f} MiB, {sample.descriptors} descriptors, {sample.threads} threads, "
        f"{clock}, {errors}"
    )


@contextmanager
def _child(folder: Path, *words: str) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen([sys.executable, *words], cwd=folder, stdout=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        port: int = sock.getsockname()[1]
        return port


if __name__ == "__main__":
    sys.exit(main())
