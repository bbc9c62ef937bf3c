"""The service over a pad for twenty minutes, by hand; from a fifth of the time on a stranger sends 2 MB/s.

``python tests/attack/soak.py --seconds 1200``. The stranger sends to the stations' UDP port what costs most to read,
and forged frames. Printed, and judged against calm: memory after a quarter of the time, gaps of LANDING_TARGET, and
the time from a frame of detections to the next LANDING_TARGET. The bounds hold on two quiet cores, one of which is the
service's alone; how long it waited for a processor shows whether they were quiet. The last line is the verdict; exit
status 1 where it failed.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import random
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from contextlib import ExitStack, suppress
from itertools import cycle, pairwise
from pathlib import Path
from typing import Any, Self

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "support"), str(Path(__file__).parent)]

from autopilot_tap import Tap  # noqa: E402
from processes import free_port  # noqa: E402
from pymavlink.dialects.v20.ardupilotmega import MAV_FRAME_BODY_FRD  # noqa: E402
from test_forged_frames import forged  # noqa: E402

from fwav_companion.cli.main import main as command  # noqa: E402
from tests.benchmarks.adversary import patterns  # noqa: E402

BYTES_PER_S = 2_000_000
DATAGRAM = 1024
MOST_RSS_MIB = 1.0
MOST_GAP_S = 0.3
MOST_LATENCY_RATIO = 2.0
MOST_WAITED = 0.02
"""Share of the time without a processor beyond which other programs are in the figures."""
PAD = """
import sys
from sitl_mock import live, scenario
places = ((0.0, -0.5, 0.3, 4.0, 30.0), (float(sys.argv[3]), -0.5, 0.3, 4.0, 30.0))
changes = {"seconds": float(sys.argv[3]), "seed": int(sys.argv[4]), "flight.waypoints": places}
# With the offset that is drawn, stamps lie in the future: a good clock shows that, and the frames are refused.
changes |= {"camera.time_offset_s": 0.0, "biases.time_offset_s": 0.005}
live.run(scenario("descent").but(changes), live.Plan(sys.argv[1], sys.argv[2]), lambda: False, lambda _: None)
"""


class DetectionTap:
    """Forwards detections to the daemon, and records when."""

    def __init__(self, service_port: int) -> None:
        self.port = free_port()
        self.seen_s: list[float] = []
        self._in = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._in.bind(("127.0.0.1", self.port))
        self._out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._out.connect(("127.0.0.1", service_port))
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        while True:
            data = self._in.recv(65536)
            self.seen_s.append(time.monotonic())
            with suppress(OSError):
                self._out.send(data)


class Stranger:
    """Sends to a port from a port of its own until it is stopped, 100 times a second.

    It is a process of its own: as a thread it would delay the clock readings of the measurement.
    """

    def __init__(self, port: int, seed: int) -> None:
        self._sent = multiprocessing.Value("q", 0)
        self._stop = multiprocessing.Event()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", port))
        hostile = [data[at : at + DATAGRAM] for data in patterns().values() for at in range(0, 16 * DATAGRAM, DATAGRAM)]
        self._datagrams = [*hostile, *forged(random.Random(seed))]
        random.Random(seed).shuffle(self._datagrams)
        self._process = multiprocessing.get_context("fork").Process(target=self._run, daemon=True)

    @property
    def sent(self) -> int:
        """Bytes so far."""
        return self._sent.value

    def start(self) -> None:
        self._process.start()

    def stop(self) -> None:
        self._stop.set()
        self._process.join()

    def _run(self) -> None:
        began_s, datagrams = time.monotonic(), cycle(self._datagrams)
        while not self._stop.wait(0.01):
            while self.sent < BYTES_PER_S * (time.monotonic() - began_s):
                data = next(datagrams)
                with suppress(OSError):
                    self._socket.send(data)
                self._sent.value += len(data)


def configured(folder: Path, autopilot: int, detections: int, stations: int) -> None:
    if command(["init", str(folder)]):
        raise RuntimeError("init failed")
    path = folder / "fwav-companion.toml"
    text = path.read_text()
    for old, new in (
        ('"serial:///dev/serial0:921600"', f'"udpin://127.0.0.1:{autopilot}"'),
        ("udpout://127.0.0.1:14550", f"udpin://127.0.0.1:{stations}"),
        ("udpin://127.0.0.1:14601", f"udpin://127.0.0.1:{detections}"),
        ("landing_target = false", "landing_target = true"),
        ('landing_label = ""', 'landing_label = "pad"'),
        ('\nfile = ""', f'\nfile = "{folder}/status.json"'),
    ):
        if old not in text:
            raise RuntimeError(f"init's configuration has no {old}")
        text = text.replace(old, new, 1)
    path.write_text(text)


def is_ours(message: Any) -> bool:
    """Whether a message is the service's LANDING_TARGET. The stranger's own ones are passed to the vehicle, too, also
    those with the service's ids, as of a second program; their drawn bytes are no position in the body's frame.
    """
    ids = (message.get_srcSystem(), message.get_srcComponent())
    return (
        message.get_type() == "LANDING_TARGET"
        and ids == (1, 191)
        and (message.frame, message.position_valid) == (MAV_FRAME_BODY_FRD, 1)
    )


class Landings(list[tuple[float, Any]]):
    """Keeps the service's LANDING_TARGET alone.

    Millions of the stranger's messages, which are passed on, would have garbage collection hold up the telemetry for
    seconds.
    """

    def __iadd__(self, seen: Iterable[tuple[float, Any]]) -> Self:
        """Keep those of them that are the service's."""
        return super().__iadd__([each for each in seen if is_ours(each[1])])


def waited_s(pid: int) -> float:
    """Seconds for which the service's main thread could run, and other processes had the processors."""
    return int(Path(f"/proc/{pid}/schedstat").read_text().split()[1]) / 1e9


def rss_mib(pid: int) -> float:
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def main(words: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=1200.0)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args(words)
    seconds, seed = arguments.seconds, arguments.seed
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        autopilot, detections, stations = free_port(), free_port(), free_port()
        configured(folder, autopilot, detections, stations)
        run = [sys.executable, "-m", "fwav_companion", "run", "--config", "fwav-companion.toml"]
        daemon = subprocess.Popen(run, cwd=folder, stdout=subprocess.DEVNULL, stderr=(folder / "log").open("wb"))
        stack.callback(daemon.kill)
        # The stranger and the autopilot are other machines: they take no time of the service's core.
        first, *others = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(daemon.pid, {first})
        os.sched_setaffinity(0, others or {first})
        tap, frames = stack.enter_context(Tap(autopilot)), DetectionTap(detections)
        tap.seen = Landings()
        urls = (f"udpout:127.0.0.1:{tap.port}", f"127.0.0.1:{frames.port}")
        mock = subprocess.Popen([sys.executable, "-c", PAD, *urls, str(seconds + 30.0), str(seed)], cwd=folder)
        stack.callback(mock.kill)
        began_s, stranger, sizes = time.monotonic(), Stranger(stations, seed), list[tuple[float, float]]()
        starts = False
        while (now_s := time.monotonic() - began_s) < seconds:
            if now_s >= seconds / 5.0 and not starts:
                starts = True
                stranger.start()
            time.sleep(1.0)
            sizes.append((now_s, rss_mib(daemon.pid)))
            if now_s // 60.0 > (now_s - 1.0) // 60.0:
                print(f"{now_s / 60.0:5.1f} min: {sizes[-1][1]:.2f} MiB", flush=True)
        waited = waited_s(daemon.pid) / seconds
        stranger.stop()
        landings_s = [at_s for at_s, _ in tap.seen]
        daemon.send_signal(signal.SIGTERM)
        status = daemon.wait(20.0)
        faults = (folder / "log").read_text(errors="replace").count("internal fault")
    calm = (began_s + seconds / 10.0, began_s + seconds / 5.0)
    attack = (began_s + seconds / 5.0 + 1.0, began_s + seconds)
    print(f"the service waited {waited:.1%} of the time for a processor" + ": not quiet" * (waited > MOST_WAITED))
    failures = [f"exit status {status}"] * bool(status) + [f"{faults} internal faults"] * bool(faults)
    return _judged(failures, sizes, seconds, stranger.sent, frames.seen_s, landings_s, calm=calm, attack=attack)


def _judged(
    failures: list[str],
    sizes: Sequence[tuple[float, float]],
    seconds: float,
    sent: int,
    frames_s: Sequence[float],
    landings_s: Sequence[float],
    *,
    calm: tuple[float, float],
    attack: tuple[float, float],
) -> int:
    settled = [size for at_s, size in sizes if at_s >= seconds / 4.0]
    growth = max(settled) - settled[0]
    print(f"memory: {settled[0]:.1f} MiB after {seconds / 4.0:.0f} s, at most {growth:+.2f} MiB later")
    failures += [f"memory grows by {growth:.2f} MiB"] * (growth > MOST_RSS_MIB)
    p99 = {}
    for name, (start_s, end_s) in (("calm", calm), ("attack", attack)):
        of_phase = [at_s for at_s in landings_s if start_s <= at_s <= end_s]
        if len(of_phase) < 10:
            failures.append(f"{name}: {len(of_phase)} LANDING_TARGET")
            continue
        gap_s = max(b - a for a, b in pairwise(of_phase))
        delays_s = [d for f in frames_s if start_s <= f <= end_s and (d := _delay_s(f, landings_s)) is not None]
        p99[name] = statistics.quantiles(delays_s, n=100)[98]
        print(
            f"{name}: {len(of_phase) / (end_s - start_s):.1f} LANDING_TARGET/s, longest gap {gap_s * 1e3:.0f} ms;"
            f" frame to LANDING_TARGET: median {statistics.median(delays_s) * 1e3:.1f} ms, p99 {p99[name] * 1e3:.1f} ms"
        )
        failures += [f"{name}: a gap of {gap_s:.2f} s"] * (gap_s > MOST_GAP_S)
    if len(p99) == 2 and p99["attack"] > MOST_LATENCY_RATIO * p99["calm"]:
        failures.append(f"p99 is {p99['attack'] / p99['calm']:.1f} times that of calm")
    print(f"{sent / 1e6:.0f} MB were sent")
    print(f"failed: {'; '.join(failures)}" if failures else "passed")
    return int(bool(failures))


def _delay_s(frame_s: float, landings_s: Sequence[float]) -> float | None:
    after = bisect_right(landings_s, frame_s)
    return landings_s[after] - frame_s if after < len(landings_s) else None


if __name__ == "__main__":
    sys.exit(main())
