"""Where detections and the truth go: a UDP or Unix address, or files."""

from __future__ import annotations

import contextlib
import re
import socket
from pathlib import Path
from typing import Any, TextIO

from sitl_mock import truth
from sitl_mock.camera import FrameTruth, datagram
from sitl_mock.simulate import Event, Simulation, VehicleTruth
from sitl_mock.transports import port_from


class Detections:
    """HOST:PORT or unix:PATH, datagrams that nobody need receive."""

    def __init__(self, address: str) -> None:
        self._target: Any
        if address.startswith("unix:"):
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self._target = re.sub(r"^unix:(//)?", "", address)
        else:
            match = re.fullmatch(r"(?:udpout:)?(?://)?\[?(.*?)]?:(\d+)", address)
            if not match:
                raise ValueError(f"{address!r} is no address for detections: HOST:PORT or unix:PATH")
            family = socket.AF_INET6 if ":" in match[1] else socket.AF_INET
            self._target = (match[1], port_from(match[2], address))
            self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def send(self, frame: dict[str, Any]) -> None:
        """One frame, or nothing where nobody listens."""
        with contextlib.suppress(OSError):
            self._socket.sendto(datagram(frame), self._target)

    def close(self) -> None:
        """Closes the socket."""
        self._socket.close()


class DetectionFile:
    """A .jsonl of detections, each with the instant of its arrival."""

    def __init__(self, path: Path, unix_minus_host_s: float) -> None:
        self._file = path.open("w", encoding="utf-8")
        self._unix_minus_host_s = unix_minus_host_s

    def write(self, frame: dict[str, Any], host_ns: int) -> None:
        """One line."""
        received_unix = round(host_ns * 1e-9 + self._unix_minus_host_s, 6)
        self._file.write(truth.json_line({**frame, "received_unix": received_unix}))

    def close(self) -> None:
        """Closes the file."""
        self._file.close()


class TruthFile:
    """Header at once, lines as they come, what became of LANDING_TARGET and the summary at the end."""

    def __init__(self, path: Path, simulation: Simulation) -> None:
        self._simulation = simulation
        self._file: TextIO = path.open("w", encoding="utf-8")
        self._write(truth.header(simulation))
        self._file.flush()

    def take(self, event: Event) -> None:
        """Keeps what is truth."""
        if isinstance(event[1], FrameTruth | VehicleTruth):
            self._write(truth.line(event[1]))

    def close(self) -> None:
        """The last lines."""
        for accepted in self._simulation.vehicle.precland.accepted:
            self._write({"type": "landing", **accepted})
        self._write(truth.summary(self._simulation))
        self._file.close()

    def _write(self, value: dict[str, Any]) -> None:
        self._file.write(truth.json_line(value))
