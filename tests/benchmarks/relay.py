"""CPU time of relaying a frame from UDP to UDP: our links and node in one process against a plain recv/send loop in C.

Bursts enter at one socket and are awaited at another, so no datagram is lost and both relays get the same pattern.
``python -m tests.benchmarks.relay``
"""

from __future__ import annotations

import asyncio
import multiprocessing
import resource
import shutil
import socket
import subprocess
import tempfile
from pathlib import Path
from statistics import median

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.links.reconnect import make_link
from fwav_companion.links.url import parse_link_url
from fwav_companion.mavlink.router.node import LinkPolicy, Node
from tests.benchmarks.figure import Figure
from tests.benchmarks.standard_stream import frames

BURST = 16
"""Datagrams in a burst: as many frames as one serial read or one telemetry period brings."""
FRAMES = 20_000
ROUNDS = 5

C_LOOP = r"""
#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>
int main(int argc, char **argv) {
    struct sockaddr_in own = {0}, peer = {0};
    char frame[2048];
    int in = socket(AF_INET, SOCK_DGRAM, 0), out = socket(AF_INET, SOCK_DGRAM, 0);
    long wanted = atol(argv[3]);
    own.sin_family = peer.sin_family = AF_INET;
    own.sin_addr.s_addr = peer.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    own.sin_port = htons(atoi(argv[1]));
    peer.sin_port = htons(atoi(argv[2]));
    if (bind(in, (struct sockaddr *)&own, sizeof own)) return 2;
    if (connect(out, (struct sockaddr *)&peer, sizeof peer)) return 2;
    for (long i = 0; i < wanted; i++) {
        ssize_t n = recv(in, frame, sizeof frame, 0);
        if (n > 0) send(out, frame, n, 0);
    }
    struct rusage used;
    getrusage(RUSAGE_SELF, &used);
    printf("%f\n", used.ru_utime.tv_sec + used.ru_stime.tv_sec + (used.ru_utime.tv_usec + used.ru_stime.tv_usec) / 1e6);
    return 0;
}
"""


def _cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def _relay(own: int, peer: int, result: multiprocessing.Queue[float], count: int) -> None:
    """Our own relay in a process of its own; its CPU after the first burst, until all are through."""
    out = LinkPolicy("out", "gcs", forward_rate_requests=True, datagrams=True)
    node = Node([LinkPolicy("in", "autopilot", datagrams=True), out], wanted=[])
    seen = 0
    start = 0.0
    done = asyncio.Event()

    def on_bytes(name: str, data: bytes) -> bool:
        nonlocal seen, start
        received = node.receive(name, data, HostNs(int(loop.time() * 1e6) * 1000))
        for link, joined in received.forwards:
            links[link].send(joined)
        start = start or _cpu_s()
        seen += len(received.frames)
        if seen >= count:
            done.set()
        return received.subscribes

    async def run() -> None:
        nonlocal loop
        loop = asyncio.get_running_loop()
        for link in links.values():
            link.start()
        await done.wait()
        result.put(_cpu_s() - start)
        for link in links.values():
            link.close()

    loop = asyncio.new_event_loop()
    links = {
        "in": make_link("in", parse_link_url(f"udpin://127.0.0.1:{own}"), on_bytes, lambda *_: None),
        "out": make_link("out", parse_link_url(f"udpout://127.0.0.1:{peer}"), on_bytes, lambda *_: None),
    }
    asyncio.run(run())


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        return int(sock.getsockname()[1])


def _feed(own: int, sink: socket.socket, stream: list[bytes], burst: int) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as source:
        source.bind(("127.0.0.1", 0))
        _wait_until_listening(source, own, sink, stream[0])
        for i in range(1, len(stream), burst):
            batch = stream[i : i + burst]
            for frame in batch:
                source.sendto(frame, ("127.0.0.1", own))
            expected, got = b"".join(batch), b""
            while len(got) < len(expected):
                got += sink.recv(2048)
            if got != expected:
                raise AssertionError("the relay changed or reordered a frame")


def _wait_until_listening(source: socket.socket, own: int, sink: socket.socket, frame: bytes) -> None:
    sink.settimeout(0.1)
    for _ in range(100):
        source.sendto(frame, ("127.0.0.1", own))
        try:
            sink.recv(2048)
        except TimeoutError:
            continue
        sink.settimeout(5.0)
        return
    raise AssertionError("the relay did not start")


def _ours(stream: list[bytes], burst: int) -> float:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sink:
        sink.bind(("127.0.0.1", 0))
        own = _free_port()
        result: multiprocessing.Queue[float] = multiprocessing.Queue()
        process = multiprocessing.Process(target=_relay, args=(own, sink.getsockname()[1], result, len(stream)))
        process.start()
        _feed(own, sink, stream, burst)
        used = result.get(timeout=10)
        process.join()
    return used


def _c_loop(program: Path, stream: list[bytes], burst: int) -> float:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sink:
        sink.bind(("127.0.0.1", 0))
        own = _free_port()
        arguments = [str(program), str(own), str(sink.getsockname()[1]), str(len(stream))]
        with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as process:
            _feed(own, sink, stream, burst)
            return float(process.communicate(timeout=10)[0])


def measure(burst: int = BURST) -> list[Figure]:
    """The ratio of CPU times; empty where there is no C compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        return []
    stream = frames(FRAMES)
    with tempfile.TemporaryDirectory() as folder:
        source, program = Path(folder) / "loop.c", Path(folder) / "loop"
        source.write_text(C_LOOP)
        subprocess.run([compiler, "-O2", "-o", program, source], check=True)
        pairs = [(_ours(stream, burst), _c_loop(program, stream, burst)) for _ in range(ROUNDS)]
    ours, theirs = median(a for a, _ in pairs), median(b for _, b in pairs)
    detail = f"ours {ours / FRAMES * 1e6:.2f} us, C {theirs / FRAMES * 1e6:.2f} us a frame, bursts of {burst}"
    return [Figure("relay a frame, UDP to UDP, against a C loop", ours / theirs, 2.0, False, detail)]


if __name__ == "__main__":
    for figure in measure():
        print(figure)
