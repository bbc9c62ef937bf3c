"""Serial ports: found by path or USB ids at each attempt, opened in a daemon thread, exclusive, non-blocking."""

from __future__ import annotations

import asyncio
import errno
import os
import termios
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Protocol

import msgspec
import serial
from serial.tools import list_ports

from fwav_companion.blocking import in_daemon_thread
from fwav_companion.errors import LinkError
from fwav_companion.fair_queues import Origin
from fwav_companion.links.base import STREAM_READ_BYTES, Connection, LinkReceiver
from fwav_companion.links.streams import BoundedWriter
from fwav_companion.links.url import SerialUrl
from fwav_companion.types.network_status import LinkReport

OPEN_WAIT_S = 5.0
"""Longest wait of one attempt. A healthy port opens in milliseconds; the open call of a USB device may hang."""
QUEUE_S = 0.5
"""Capacity of the queue, in seconds at the line's speed: older telemetry is useless."""
SMALLEST_QUEUE_BYTES = 2048
"""Least capacity of the queue, for the slowest line: several of the longest frames."""


class UsbIdentity(msgspec.Struct, frozen=True):
    """Identity that a USB device keeps when it reappears under another name."""

    vendor_id: int
    product_id: int
    serial_number: str


class PortInfo(Protocol):
    """pyserial's description of a port."""

    device: str
    vid: int | None
    pid: int | None
    serial_number: str | None


class OpenedPort(msgspec.Struct, frozen=True):
    """An open port and the name under which it was found."""

    port: serial.Serial
    device: str
    identity: UsbIdentity | None


class SerialOpener:
    """Opens the device that a serial URL names, or the same device after it reappeared under another name."""

    def __init__(self, url: SerialUrl, list_all: Callable[[], Sequence[PortInfo]] = list_ports.comports) -> None:
        self._url = url
        self._list_all = list_all
        self._identity: UsbIdentity | None = None
        """Identity of the device that the path named when it was last open."""
        self._opening: asyncio.Task[OpenedPort] | None = None
        """The one open call under way: the next attempt waits for a hanging one and does not start another."""

    async def open(self, receiver: LinkReceiver) -> Connection:
        """An open port. OSError or LinkError if the device is missing, in use, or hangs."""
        if self._opening is None:
            call = partial(find_and_open, self._url, self._identity, self._list_all)
            coroutine = in_daemon_thread(call, name=f"open {self._url}", undo=_close_unwanted)
            self._opening = asyncio.get_running_loop().create_task(coroutine)
        done, _ = await asyncio.wait({self._opening}, timeout=OPEN_WAIT_S)
        if not done:
            raise LinkError(f"the device does not open within {OPEN_WAIT_S:g} s")
        opening, self._opening = self._opening, None
        opened = opening.result()
        self._identity = opened.identity or self._identity
        return SerialConnection(opened.port, opened.device, self._url.baud, receiver)

    def close(self) -> None:
        """Abandon the thread; a port that it still opens is closed."""
        opening, self._opening = self._opening, None
        if opening is not None and not opening.cancel() and opening.exception() is None:
            _close(opening.result().port)  # opened after the last attempt had stopped waiting


def find_and_open(
    url: SerialUrl, identity: UsbIdentity | None, list_all: Callable[[], Sequence[PortInfo]]
) -> OpenedPort:
    """Find and open the device; this blocks. LinkError names the step that failed."""
    device = url.device
    ports: tuple[PortInfo, ...] = ()
    if not (device and Path(device).exists()):
        ports = tuple(list_all())
        device = _find(url, identity, ports)
    try:
        port = serial.Serial(device, url.baud, timeout=0, write_timeout=0, exclusive=True)
    except (serial.SerialException, ValueError) as error:  # ValueError: the driver does not support the speed
        raise LinkError(_reason(device, error)) from error
    _wait_for_a_byte(port.fd)
    return OpenedPort(port, device, _identity_of(device, ports or tuple(list_all())))


def _find(url: SerialUrl, identity: UsbIdentity | None, ports: Sequence[PortInfo]) -> str:
    """Name of the first device that has the URL's ids, or the identity that the URL's device had before."""
    if url.device and identity is None:
        raise LinkError(f"{url.device}: no such device")
    names = sorted(
        (len(port.device), port.device)
        for port in ports
        if (identity is not None and _identity(port) == identity)
        or (not url.device and (port.vid, port.pid) == (url.vendor_id, url.product_id))
    )
    if not names:
        raise LinkError(f"{url.device or f'USB device {url.vendor_id:04x}:{url.product_id:04x}'}: no such device")
    return names[0][1]


def _identity_of(device: str, ports: Sequence[PortInfo]) -> UsbIdentity | None:
    """Identity of the open device, also through symbolic links such as /dev/serial/by-id/...; None if it is not USB."""
    real = os.path.realpath(device)
    return next((_identity(port) for port in ports if os.path.realpath(port.device) == real), None)


def _identity(port: PortInfo) -> UsbIdentity | None:
    if port.vid is None or port.pid is None:
        return None
    return UsbIdentity(port.vid, port.pid, port.serial_number or "")


def _wait_for_a_byte(fd: int) -> None:
    """Set VMIN to 1: an empty read then means a hang-up only (with pyserial's 0 it also means "no data")."""
    settings = termios.tcgetattr(fd)
    settings[6][termios.VMIN] = 1
    termios.tcsetattr(fd, termios.TCSANOW, settings)


def _reason(device: str, error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number == errno.EAGAIN:
        return f"{device}: in use by another program"
    if f"({errno.ENOTTY}," in str(error):  # pyserial keeps the number of tcgetattr in the text alone
        return f"{device}: not a serial port"
    return f"{device}: {os.strerror(number) if number else error}"


def _close_unwanted(opened: OpenedPort) -> None:
    _close(opened.port)


def _close(port: serial.Serial) -> None:
    """Close at once and drop the driver's queue; otherwise closing waits for the line for up to 30 s."""
    with suppress(OSError, termios.error):
        termios.tcflush(port.fd, termios.TCOFLUSH)
    with suppress(OSError):
        port.close()


class SerialConnection:
    """One open serial port."""

    def __init__(self, port: serial.Serial, device: str, baud: int, receiver: LinkReceiver) -> None:
        self._port = port
        self._device = device
        self._receiver = receiver
        self._fd: int = port.fd
        self._loop = asyncio.get_running_loop()
        capacity = max(SMALLEST_QUEUE_BYTES, round(QUEUE_S * baud / 10))
        self._writer = BoundedWriter(self._fd, partial(os.write, self._fd), capacity, receiver)
        self._loop.add_reader(self._fd, self._read)

    def send(self, data: bytes, *, origin: Origin | None = None) -> None:
        """Write whole frames now, or queue them."""
        self._writer.send(data, origin=origin)

    def poll(self) -> None:
        """Pass on a bounded part of the received bytes."""
        self._read()

    def close(self) -> None:
        """Release the port."""
        self._loop.remove_reader(self._fd)
        self._writer.close()
        _close(self._port)

    def status(self) -> LinkReport:
        """The name under which the device was found."""
        return LinkReport(device=self._device)

    def _read(self) -> None:
        try:
            data = os.read(self._fd, STREAM_READ_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            self._end(error.strerror or str(error))
            return
        if data:
            self._receiver.on_bytes(data)
        else:
            self._end("hung up")

    def _end(self, why: str) -> None:
        self._loop.remove_reader(self._fd)  # a device that is gone stays readable
        self._receiver.on_lost(f"{self._device}: {why}")
