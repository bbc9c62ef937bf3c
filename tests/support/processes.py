"""The service and the mock as processes of their own, as a user runs them."""

from __future__ import annotations

import os
import random
import re
import select
import signal
import socket
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

STARTING_S = 20.0
"""Time limit for a start, seconds: it detects a hang, not slowness, because these machines are shared."""


def _heeds_signals() -> None:
    """Restore default signal handling, as in a terminal: the test runner may ignore signals, as nohup does, and
    children inherit that.
    """
    for number in (signal.SIGHUP, signal.SIGINT):
        signal.signal(number, signal.SIG_DFL)


class Process:
    """A child process whose output can be awaited line by line, and that takes input."""

    def __init__(
        self, *words: str, folder: Path, program: Sequence[str] = (sys.executable, "-m"), **environment: str
    ) -> None:
        self._child = subprocess.Popen(
            [*program, *words],
            cwd=folder,
            env={**os.environ, "PYTHONUNBUFFERED": "1", **environment},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            preexec_fn=_heeds_signals,
        )
        self.said = ""

    @property
    def pid(self) -> int:
        """Process id of the child."""
        return self._child.pid

    def write_line(self, line: str) -> None:
        """Write one line to its stdin."""
        assert self._child.stdin is not None
        self._child.stdin.write(line.encode() + b"\n")
        self._child.stdin.flush()

    def wait_for(self, pattern: str, within_s: float = STARTING_S) -> re.Match[str]:
        """The first match in its output, which is awaited."""
        deadline = time.monotonic() + within_s
        stream = self._child.stdout
        assert stream is not None
        while (match := re.search(pattern, self.said)) is None:
            left = deadline - time.monotonic()
            assert left > 0, f"{pattern!r} never came; it said:\n{self.said}"
            if select.select([stream], [], [], left)[0]:
                data = os.read(stream.fileno(), 65536)
                assert data, f"it ended without {pattern!r}; it said:\n{self.said}"
                self.said += data.decode(errors="replace")
        return match

    def stop(self, number: int = signal.SIGTERM, within_s: float = 10.0) -> int:
        """Send the signal; returns the exit status."""
        self._child.send_signal(number)
        return self.end(within_s)

    def end(self, within_s: float = 60.0) -> int:
        """The exit status after the process has ended by itself."""
        output, _ = self._child.communicate(timeout=within_s)
        self.said += output.decode(errors="replace")
        return self._child.returncode

    def kill(self) -> None:
        """Kill the process, so that no test leaves it running."""
        if self._child.poll() is None:
            self._child.kill()
        for stream in (self._child.stdin, self._child.stdout):
            if stream is not None and not stream.closed:
                stream.close()
        self._child.wait()


@contextmanager
def process(*words: str, folder: Path, **how: Any) -> Iterator[Process]:
    """A child process for the duration of the block."""
    child = Process(*words, folder=folder, **how)
    try:
        yield child
    finally:
        child.kill()


SIGNING_EPOCH_S = 1_420_070_400
"""2015-01-01 UTC, from which signatures count units of 10 us."""


class GroundStation:
    """The UDP socket of a ground station that encodes and decodes with pymavlink, not with our codec."""

    def __init__(self, system: int = 255, key: bytes | None = None) -> None:
        """``key``: signs the messages that it sends; received unsigned messages are still accepted."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.2)
        self._parser = dialect.MAVLink(None)
        self._parser.robust_parsing = True
        self.port: int = self._socket.getsockname()[1]
        self._peer: tuple[str, int] | None = None
        self._received: deque[dialect.MAVLink_message] = deque()
        self._sender = dialect.MAVLink(None, srcSystem=system, srcComponent=190)
        if key is not None:
            self._parser.signing.secret_key = key
            self._parser.signing.allow_unsigned_callback = lambda *_: True
            self._sender.signing.secret_key = key
            self._sender.signing.sign_outgoing = True
            self._sender.signing.timestamp = round((time.time() - SIGNING_EPOCH_S) * 1e5)

    def listen(self, until: str, count: int = 1, within_s: float = 30.0) -> list[dialect.MAVLink_message]:
        """Everything up to the count-th message of that name."""
        return self.listen_for(lambda message: message.get_type() == until, count, within_s, until)

    def listen_for(
        self, wanted: Callable[[Any], bool], count: int = 1, within_s: float = 30.0, what: str = "it"
    ) -> list[dialect.MAVLink_message]:
        """Everything up to the count-th message that is wanted."""
        heard: list[dialect.MAVLink_message] = []
        deadline = time.monotonic() + within_s
        while count > 0:
            names = sorted({message.get_type() for message in heard})
            assert time.monotonic() < deadline, f"{what} never came, only {names}"
            message = self._next()
            if message is not None:
                heard.append(message)
                count -= wanted(message)
        return heard

    def listen_during(self, seconds: float) -> list[dialect.MAVLink_message]:
        """Everything that comes in this time."""
        heard: list[dialect.MAVLink_message] = []
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            message = self._next()
            if message is not None:
                heard.append(message)
        return heard

    def _next(self) -> dialect.MAVLink_message | None:
        """One message, of possibly several in one datagram; None: nothing arrived for a while."""
        if not self._received:
            try:
                data, self._peer = self._socket.recvfrom(65536)
            except TimeoutError:
                return None
            self._received.extend(self._parser.parse_buffer(data) or [])
        return self._received.popleft() if self._received else None

    def send(self, message: dialect.MAVLink_message) -> bytes:
        """Send to the last sender; returns the bytes sent."""
        frame = self.packed(message)
        self.send_bytes(frame)
        return frame

    def packed(self, message: dialect.MAVLink_message) -> bytes:
        """The next frame of this station."""
        frame = bytes(message.pack(self._sender))
        self._sender.seq = (self._sender.seq + 1) % 256
        return frame

    def send_bytes(self, data: bytes) -> None:
        """Send the bytes unchanged."""
        assert self._peer is not None
        self._socket.sendto(data, self._peer)

    def beat(self) -> None:
        """One heartbeat."""
        self.send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))

    def command(self, component: int, number: int, *params: float) -> bytes:
        """A COMMAND_LONG to a component of system 1; the bytes that were sent."""
        frame = self.packed_command(component, number, *params)
        self.send_bytes(frame)
        return frame

    def packed_command(self, component: int, number: int, *params: float) -> bytes:
        """The bytes of a COMMAND_LONG, without sending it."""
        padded = [*params, *[0.0] * (7 - len(params))]
        return self.packed(dialect.MAVLink_command_long_message(1, component, number, 0, *padded))

    def ask(self, component: int, number: int, *params: float) -> tuple[int, list[dialect.MAVLink_message]]:
        """(result of a command, every message received until the answer)."""
        self.command(component, number, *params)
        heard = self.listen_for(
            lambda m: m.get_type() == "COMMAND_ACK" and (m.command, m.get_srcComponent()) == (number, component),
            what=f"an acknowledgement of {number}",
        )
        return heard[-1].result, heard

    def close(self) -> None:
        self._socket.close()


PORTS = range(10_000, 32_000)
"""Ports below the range from which Linux assigns ephemeral ports, so that no such socket takes one in the meantime."""
_draw = random.SystemRandom()
_given: set[int] = set()


def free_port() -> int:
    """A port on loopback, free for UDP and TCP, that no other worker of this run and no earlier test gets."""
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % 64
    while True:
        port = _draw.randrange(PORTS.start + worker, PORTS.stop, 64)
        if port not in _given and _is_free(port):
            _given.add(port)
            return port


def _is_free(port: int) -> bool:
    family, every = (socket.AF_INET6, "::") if socket.has_dualstack_ipv6() else (socket.AF_INET, "")
    for kind in (socket.SOCK_DGRAM, socket.SOCK_STREAM):
        with socket.socket(family, kind) as probe:
            if family == socket.AF_INET6:
                probe.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 0)
            try:
                probe.bind((every, port))
            except OSError:
                return False
    return True
