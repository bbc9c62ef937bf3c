"""Outputs of detections and truth: a UDP or Unix address, or files."""

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
    """Sends detections as datagrams to HOST:PORT or unix:PATH; a receiver is not required."""

    def __init__(self, address: str) -> None:
        self._target: Any
        if address.startswith("unix:"):
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self._target = re.sub(r"^unix:(//)?", "", address)
        else:
            match = re.fullmatch(r"(?:udpout:)?(?://)?\[?(.*?)]?:(\d+)", address)
            if not match:
                raise ValueError(f"{address!r} is not an address for detections: expected HOST:PORT or unix:PATH")
            family = socket.AF_INET6 if ":" in match[1] else socket.AF_INET
            self._target = (match[1], port_from(match[2], address))
            self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def send(self, frame: dict[str, Any]) -> None:
        """Sends one frame; it is lost where there is no receiver."""
        with contextlib.suppress(OSError):
            self._socket.sendto(datagram(frame), self._target)

    def close(self) -> None:
        """Closes the socket."""
        self._socket.close()


class DetectionLines:
    """JSON Lines of detections, each with its instant of arrival."""

    def __init__(self, file: TextIO, unix_minus_host_s: float) -> None:
        self._file = file
        self._unix_minus_host_s = unix_minus_host_s

    def write(self, frame: dict[str, Any], host_ns: int) -> None:
        """Writes one line."""
        received_unix = round(host_ns * 1e-9 + self._unix_minus_host_s, 6)
        self._file.write(truth.json_line({**frame, "received_unix": received_unix}))


class DetectionFile(DetectionLines):
    """JSON Lines file of detections."""

    def __init__(self, path: Path, unix_minus_host_s: float) -> None:
        super().__init__(path.open("w", encoding="utf-8"), unix_minus_host_s)

    def close(self) -> None:
        """Closes the file."""
        self._file.close()


class TruthFile:
    """Truth file: header at once, one line per event, LANDING_TARGET results and the summary at the end."""

    def __init__(self, path: Path, simulation: Simulation) -> None:
        self._simulation = simulation
        self._file: TextIO = path.open("w", encoding="utf-8")
        self._write(truth.header(simulation))
        self._file.flush()

    def take(self, event: Event) -> None:
        """Writes an event that is part of the truth."""
        if isinstance(event[1], FrameTruth | VehicleTruth):
            self._write(truth.line(event[1]))

    def close(self) -> None:
        """Writes the last lines and closes the file."""
        for accepted in self._simulation.vehicle.precland.accepted:
            self._write({"type": "landing", **accepted})
        self._write(truth.summary(self._simulation))
        self._file.close()

    def _write(self, value: dict[str, Any]) -> None:
        self._file.write(truth.json_line(value))
