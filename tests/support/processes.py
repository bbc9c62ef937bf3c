"""The service and the mock as processes of their own, as a user runs them."""

from __future__ import annotations

import os
import re
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

STARTING_S = 20.0
"""A hang, not slowness: these machines are shared."""


class Process:
    """A child whose words can be waited for, line by line, and that can be spoken to."""

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
        )
        self.said = ""

    @property
    def pid(self) -> int:
        """Of the child."""
        return self._child.pid

    def tell(self, line: str) -> None:
        """One line on its stdin."""
        assert self._child.stdin is not None
        self._child.stdin.write(line.encode() + b"\n")
        self._child.stdin.flush()

    def wait_for(self, pattern: str, within_s: float = STARTING_S) -> re.Match[str]:
        """The first match in what it has said, which may come later."""
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
        """Its exit status after the signal."""
        self._child.send_signal(number)
        return self.end(within_s)

    def end(self, within_s: float = 60.0) -> int:
        """Its exit status, when it has ended by itself."""
        output, _ = self._child.communicate(timeout=within_s)
        self.said += output.decode(errors="replace")
        return self._child.returncode

    def kill(self) -> None:
        """However the test ended, nothing is left running."""
        if self._child.poll() is None:
            self._child.kill()
        for stream in (self._child.stdin, self._child.stdout):
            if stream is not None and not stream.closed:
                stream.close()
        self._child.wait()


@contextmanager
def process(*words: str, folder: Path, **how: Any) -> Iterator[Process]:
    """A child for as long as the block lasts."""
    child = Process(*words, folder=folder, **how)
    try:
        yield child
    finally:
        child.kill()


class GroundStation:
    """A UDP socket that a ground station would have, with pymavlink behind it: not our codec."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.2)
        self._parser = dialect.MAVLink(None)
        self._parser.robust_parsing = True
        self.port: int = self._socket.getsockname()[1]
        self._peer: tuple[str, int] | None = None
        self._sender = dialect.MAVLink(None, srcSystem=255, srcComponent=190)

    def listen(self, until: str, count: int = 1, within_s: float = 30.0) -> list[dialect.MAVLink_message]:
        """Everything up to the count-th message of that name."""
        heard: list[dialect.MAVLink_message] = []
        deadline = time.monotonic() + within_s
        while count > 0:
            names = sorted({message.get_type() for message in heard})
            assert time.monotonic() < deadline, f"{until} never came, only {names}"
            try:
                data, self._peer = self._socket.recvfrom(65536)
            except TimeoutError:
                continue
            for message in self._parser.parse_buffer(data) or []:
                heard.append(message)
                count -= message.get_type() == until
        return heard

    def send(self, message: dialect.MAVLink_message) -> None:
        """To whoever was heard last."""
        assert self._peer is not None
        self._socket.sendto(message.pack(self._sender), self._peer)

    def close(self) -> None:
        self._socket.close()


def free_port() -> int:
    """A UDP port on loopback that nobody has now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
