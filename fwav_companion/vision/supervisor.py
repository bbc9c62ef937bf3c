"""SHELL: keeps the vision process running: starts it, receives its frames, and replaces it when it dies or hangs."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Protocol

import msgspec

from fwav_companion.blocking import in_daemon_thread
from fwav_companion.types import DeliveryReport
from fwav_companion.types.spots import QUESTION, REFUSAL, SpotRefused
from fwav_companion.types.status import VisionReport
from fwav_companion.types.track_marks import MARKS_QUESTION
from fwav_companion.vision.detections_in import DRAIN_LIMIT, LARGEST_DATAGRAM
from fwav_companion.vision.frame_receiver import FrameReceiver
from fwav_companion.vision.task import KEPT_PICTURE, KeptPicturesRule, VisionOrders, VisionState, VisionTask

FIRST_RETRY_S, LONGEST_RETRY_S = 1.0, 30.0
LIVED_LONG_S = 60.0
"""Lifetime of the process, seconds, after which the delay until the next start is short again."""
SILENCE_S = 15.0
"""Longest silence of the process, seconds: it sends a message every two; a slow board needs ten to load OpenCV."""
LOOK_S = 0.5
"""Interval of the checks for silence."""
REAP_S = 0.2
"""Longest wait for a killed process, seconds: it ends within milliseconds, or hangs in the kernel and is abandoned."""
ENVIRONMENT = {"OPENCV_LOG_LEVEL": "ERROR", "OPENCV_FFMPEG_LOGLEVEL": "-8"}
"""Environment that suppresses the libraries' logs: FFmpeg repeats its messages at every attempt; the daemon reports a
failure once. -8 is FFmpeg's AV_LOG_QUIET."""
_STATE = b'{"vision":'

BORROWED = (
    "import runpy, sys; sys.path += sys.argv.pop(1).split(':'); runpy.run_module({worker!r}, run_name='__main__')"
)
"""Program for another interpreter: this service's package and libraries come last in its path, so that it prefers its
own libraries. The modules of picamera2 are compiled for its own numpy, and fail with a newer one."""
WORKER = "fwav_companion.vision.worker"

MOST_JPEG = 16 << 20
"""Most bytes of a kept picture: 64 megapixels in grey."""
Started = tuple[subprocess.Popen[bytes], socket.socket]


class VisionDesk(Protocol):
    """Handles the messages of the process other than detections. A frame in the wire format identifies the picture."""

    def on_question(self, data: bytes) -> None:
        """Answer where a frame's picture shows the clicked spots."""

    def on_shown(self, data: bytes) -> None:
        """Answer where a frame's picture shows the tracks."""

    def on_picture(self, data: bytes, jpeg: bytes) -> None:
        """Record a frame's picture."""

    def on_refused(self, refused: SpotRefused) -> None:
        """Handle a clicked spot that cannot be followed."""


class VisionProcess:
    """The supervised process. ``start`` and ``close`` are called once each, from a running loop; nothing blocks."""

    def __init__(
        self,
        task: VisionTask,
        receiver: FrameReceiver,
        on_state: Callable[[VisionReport], None],
        desk: VisionDesk | None = None,
        *,
        kept: KeptPicturesRule = 0,
        pad_tags: tuple[str, ...] = (),
    ) -> None:
        """``on_state`` is called when pictures begin to arrive or no longer do. ``kept``: the pictures that the desk
        gets as JPEG. ``pad_tags``: labels of the tags of pads.
        """
        self._command = worker_command(task.python)
        self._orders = msgspec.json.encode(VisionOrders(task, kept, pad_tags))
        self._receiver = receiver
        self._on_state = on_state
        self._desk = desk
        self._started: Started | None = None
        self._ended = asyncio.Event()
        self._heard_s = 0.0
        self._works: bool | None = None
        self._why = ""
        self._stopped = False
        self._frozen = False
        self._delivery: DeliveryReport | None = None
        self._deaths = 0
        self._supervision: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Start the process and its supervision."""
        self._supervision = asyncio.get_running_loop().create_task(self._stay_up(), name="vision")

    def close(self) -> None:
        """End the process at once; no callback follows."""
        if self._supervision is not None:
            self._supervision.cancel()
        started = self._let_go()
        if started is not None:
            _end(started, 0.0)

    def restart(self) -> None:
        """End the process; the supervision starts another."""
        self._ended.set()

    def status(self) -> VisionReport:
        """Part of the status: the state of the camera process."""
        pid = self._started[0].pid if self._started is not None else None
        return VisionReport(
            works=bool(self._works),
            why=self._why,
            stopped=self._stopped,
            pid=pid,
            deaths=self._deaths,
            delivery=self._delivery,
        )

    async def _stay_up(self) -> None:
        retry_s = FIRST_RETRY_S
        while True:
            began_s = time.monotonic()
            try:
                started = await in_daemon_thread(self._spawn, name="start vision", undo=_undo)
            except OSError as error:
                self._tell(works=False, why=f"its process cannot be started: {error.strerror}")
            else:
                self._tell(works=False, why=await self._lived(started))
                self._deaths += 1
            if time.monotonic() - began_s > LIVED_LONG_S:
                retry_s = FIRST_RETRY_S
            await asyncio.sleep(retry_s)
            retry_s = min(2.0 * retry_s, LONGEST_RETRY_S)

    async def _lived(self, started: Started) -> str:
        """Serve one process from its start to its end; returns how it ended."""
        self._started = started
        self._frozen = False
        self._ended.clear()
        self._heard_s = time.monotonic()
        asyncio.get_running_loop().add_reader(started[1], self._drain, started[1])
        silent = False
        while not silent and not self._ended.is_set():
            with suppress(TimeoutError):
                await asyncio.wait_for(self._ended.wait(), LOOK_S)
            silent = time.monotonic() - self._heard_s > SILENCE_S
        self._let_go()
        status = await in_daemon_thread(partial(_end, started, 0.0 if silent else REAP_S), name="end vision")
        if silent:
            return f"its process was silent for {SILENCE_S:.0f} s and was ended: the camera may hang"
        return f"its process ended ({_how_ended(status)})"

    def _spawn(self) -> Started:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            ours.setblocking(False)
            try:
                process = subprocess.Popen(  # noqa: S603  # our own interpreter and module
                    [*self._command, str(theirs.fileno())],
                    pass_fds=[theirs.fileno()],
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    env={**os.environ, **ENVIRONMENT},
                )
                ours.send(self._orders)  # not on the command line, which every user of the board can read
            except OSError:
                ours.close()
                raise
        return process, ours

    def send(self, message: bytes) -> bool:
        """Send a message to the process; False if it does not run, or is too busy to read."""
        if self._started is None:
            return False
        try:
            self._started[1].send(message)
        except OSError:
            return False
        return True

    def _drain(self, sock: socket.socket) -> None:
        for _ in range(DRAIN_LIMIT):
            try:
                data, descriptors, _, _ = socket.recv_fds(sock, LARGEST_DATAGRAM, 1)
            except BlockingIOError:
                return
            except OSError:
                data, descriptors = b"", []
            if not data:
                asyncio.get_running_loop().remove_reader(sock)
                self._ended.set()
                return
            self._heard_s = time.monotonic()
            if descriptors:
                self._take_picture(data, descriptors[0])
            else:
                self._take(data)

    def _take_picture(self, data: bytes, descriptor: int) -> None:
        """Hand a kept picture to the desk, unless it is too large."""
        with open(descriptor, "rb") as file:
            if self._desk is not None and data.startswith(KEPT_PICTURE) and os.fstat(descriptor).st_size <= MOST_JPEG:
                file.seek(0)
                self._desk.on_picture(data[len(KEPT_PICTURE) : -1], file.read())

    def _take(self, data: bytes) -> None:
        if data.startswith(_STATE):
            state = msgspec.json.decode(data, type=VisionState)
            self._frozen = state.vision == "frozen"
            self._delivery = state.delivery or self._delivery
            self._tell(works=state.vision == "looking", why=state.why, stopped=state.vision == "stopped")
            return
        if data.startswith((QUESTION, MARKS_QUESTION, REFUSAL)):
            if self._desk is not None:
                _hand_over(data, self._desk)
            return
        if not self._frozen:
            self._tell(works=True, why="")
        self._receiver.hear(data)

    def _tell(self, *, works: bool, why: str, stopped: bool = False) -> None:
        self._why, self._stopped = why, stopped
        if works is not self._works:
            self._works = works
            self._on_state(self.status())

    def _let_go(self) -> Started | None:
        """Stop receiving from the process, and return it if there is one."""
        started, self._started = self._started, None
        if started is not None:
            asyncio.get_running_loop().remove_reader(started[1])
        return started


def _hand_over(data: bytes, desk: VisionDesk) -> None:
    if data.startswith(QUESTION):
        desk.on_question(data[len(QUESTION) : -1])
    elif data.startswith(MARKS_QUESTION):
        desk.on_shown(data[len(MARKS_QUESTION) : -1])
    else:
        desk.on_refused(msgspec.json.decode(data, type=SpotRefused))


def worker_command(python: str) -> list[str]:
    """The command of the vision process under this interpreter; "": that of the service."""
    if not python:
        return [sys.executable, "-m", WORKER]
    package = Path(__file__).parents[2]
    libraries = Path(msgspec.__file__).parents[1]
    return [python, "-c", BORROWED.format(worker=WORKER), f"{package}:{libraries}"]


def _end(started: Started, patience_s: float) -> int | None:
    """End the process, by force after ``patience_s``; its exit status, or None if it hangs in the kernel."""
    process, sock = started
    sock.close()
    if patience_s:
        with suppress(subprocess.TimeoutExpired):
            return process.wait(patience_s)
    process.kill()
    with suppress(subprocess.TimeoutExpired):
        return process.wait(REAP_S)
    return None


def _undo(started: Started) -> None:
    _end(started, 0.0)


def _how_ended(status: int | None) -> str:
    if status is None:
        return "it hangs in the kernel"
    return f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
