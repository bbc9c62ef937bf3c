"""``python -m fwav_companion.vision.worker FD``: a camera and a detector in a process of their own.

It sends detections over the inherited socket in the wire format, its state in between, and the pictures that a
recording keeps. A camera that hangs blocks this process and not the daemon, which then ends it and starts another.
"""

from __future__ import annotations

import os
import socket
import sys
import threading
import time
import zlib
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import closing, suppress
from pathlib import Path

import cv2
import msgspec

from fwav_companion.memory_limit import MOST_VISION, VISION_SHARE, is_want_of_memory, limit_of, set_limit
from fwav_companion.types.secrets import secrets_of
from fwav_companion.types.track_marks import MARKS_ANSWER
from fwav_companion.vision.click_watch import ClickWatch
from fwav_companion.vision.delivery import DeliveredPicture, DeliveryMeter
from fwav_companion.vision.detectors import make_detector
from fwav_companion.vision.images import (
    Detector,
    DetectorError,
    Found,
    Picture,
    SourceEndedError,
    SourceLostError,
    frame_bytes,
)
from fwav_companion.vision.newest_picture import NewestPicture
from fwav_companion.vision.picture_keeper import PictureKeeper
from fwav_companion.vision.preview import Preview
from fwav_companion.vision.preview_address import parse_preview
from fwav_companion.vision.sources import open_source
from fwav_companion.vision.task import VisionOrders, VisionState, VisionTask

SIGN_OF_LIFE_S = 2.0
"""Longest time between two messages while nothing hangs."""
OOM_SCORE = "800"
"""oom_score_adj of this process, of 1000 (proc(5)); the daemon has 0."""
EXIT_OUT_OF_MEMORY = 12
"""ENOMEM."""
RETRY_S = 1.0
"""Interval of attempts to open a missing source: a camera may be plugged in late."""
LOOK_STEP_PX = 8
"""Every eighth pixel of every eighth row distinguishes one picture from the next: 5 kB of 640x480."""
LARGEST_MESSAGE = 65536
LARGEST_ORDERS = 1 << 20
"""Most bytes of the first message: a model may have ten thousand labels."""
MOST_MESSAGES = 64
"""Most messages of the daemon that are kept for the detector: two seconds with one message a picture."""
FROZEN = "the camera repeats one picture; power it off and on"

_encode = msgspec.json.Encoder().encode


class DaemonSocket:
    """The socket to the daemon. The process ends with the daemon, however that ended."""

    def __init__(self, sock: socket.socket, hidden: Mapping[str, str]) -> None:
        """``hidden``: texts with passwords, and what stands for them in states: libraries quote the URL in errors."""
        self._hidden = hidden
        self._socket = sock
        self._messages: deque[bytes] = deque(maxlen=MOST_MESSAGES)
        self._heard = threading.Event()
        self.on_marks: Callable[[bytes], None] = _ignore
        """Takes the daemon's answers about tracks, in the socket's thread."""
        threading.Thread(target=self._receive, name="daemon", daemon=True).start()

    def send(self, message: bytes) -> None:
        """Send a frame or a state."""
        self._socket.send(message)

    def send_file(self, message: bytes, descriptor: int) -> None:
        """Send a message with the descriptor of a file."""
        socket.send_fds(self._socket, [message], [descriptor])

    def report(self, state: VisionState) -> None:
        """Send the state."""
        why = state.why
        for text, shown in self._hidden.items():
            why = why.replace(text, shown)
        self._socket.send(_encode(msgspec.structs.replace(state, why=why)))

    def messages(self, timeout_s: float = 0.0) -> list[bytes]:
        """The daemon's messages since the last call, the oldest first; waits at most this long for one."""
        self._heard.wait(timeout_s)
        self._heard.clear()
        taken = []
        while self._messages:
            taken.append(self._messages.popleft())
        return taken

    def _receive(self) -> None:
        try:
            while message := self._socket.recv(LARGEST_MESSAGE):
                if message.startswith(MARKS_ANSWER):
                    self.on_marks(message)
                else:
                    self._messages.append(message)
                    self._heard.set()
        finally:
            os._exit(0)


def main() -> None:
    """Detect until the daemon closes its end of the socket."""
    _offer_to_oom_killer()
    set_limit(limit_of(VISION_SHARE, MOST_VISION))
    sock = socket.socket(fileno=int(sys.argv[1]))
    orders = msgspec.json.decode(sock.recv(LARGEST_ORDERS), type=VisionOrders)
    task = orders.task
    daemon = DaemonSocket(sock, hidden=dict(secrets_of(task)))
    cv2.setNumThreads(task.threads)  # leaves the other cores of a small board to the flight
    try:
        detector, address = make_detector(task, orders.pad_tags), parse_preview(task.preview)
        preview = None if address is None else Preview(address, daemon.send)
        if preview is not None:
            daemon.on_marks = preview.on_marks
        keeper = PictureKeeper(orders.kept, daemon.send_file)
        while True:
            try:
                Watch(daemon, task, detector, keeper, preview=preview).watch()
            except SourceLostError as error:
                daemon.report(VisionState("lost", str(error)))
                time.sleep(RETRY_S)
    except SourceEndedError as error:
        _repeat(daemon, VisionState("ended", str(error)))
    except DetectorError as error:
        _repeat(daemon, VisionState("stopped", str(error)))
    except Exception as error:
        if not is_want_of_memory(error):
            raise
        daemon.report(VisionState("lost", "out of memory: a smaller picture or model is needed"))
        os._exit(EXIT_OUT_OF_MEMORY)  # without a trace; the daemon starts another


def _ignore(_message: bytes) -> None:
    """Ignore an answer about tracks: there is no preview."""


def _offer_to_oom_killer() -> None:
    """Let the kernel end this process before any other of the service when memory is short: the daemon restarts it."""
    with suppress(OSError):  # not on every system
        Path("/proc/self/oom_score_adj").write_text(OOM_SCORE)


def _repeat(daemon: DaemonSocket, state: VisionState) -> None:
    """Report a state that no attempt can change, for as long as the daemon lives."""
    while True:
        daemon.report(state)
        time.sleep(SIGN_OF_LIFE_S)


class Watch:
    """One opening of the source."""

    def __init__(
        self,
        daemon: DaemonSocket,
        task: VisionTask,
        detector: Detector,
        keeper: PictureKeeper,
        *,
        preview: Preview | None = None,
    ) -> None:
        self._daemon = daemon
        self._keeper = keeper
        self._preview = preview
        self._task = task
        self._detector = detector
        self._clicks = ClickWatch(daemon) if task.track_clicks else None
        self._count = 0
        self._meter = DeliveryMeter()
        self._reported_s = time.monotonic()
        self._frozen = False

    def watch(self) -> None:
        """Detect until the source is lost or ends."""
        with closing(open_source(self._task)) as source:
            while True:
                picture = source.read(SIGN_OF_LIFE_S)
                if picture is not None:
                    self._detect(picture)
                elif not (isinstance(source, NewestPicture) and source.hangs):  # silence: the daemon ends this process
                    self._report()

    def _detect(self, picture: Picture) -> None:
        arrived_s = time.monotonic()
        found, number = self._found(picture)
        self._daemon.send(frame_bytes(picture, found, number))
        self._keeper.offer(picture, found)
        if self._preview is not None:
            self._preview.offer(picture, found)
        height, width = picture.pixels.shape[:2]
        stamp_s = picture.stamp.get("time_monotonic")
        self._meter.add(
            DeliveredPicture(
                arrived_s=arrived_s,
                detected_s=time.monotonic(),
                size=(width, height),
                look=zlib.crc32(picture.pixels[::LOOK_STEP_PX, ::LOOK_STEP_PX].tobytes()),
                stamp_s=stamp_s,
                exposure_s=picture.exposure_s,
                skipped=picture.skipped,
                clock=picture.clock or next(iter(picture.stamp)),
            )
        )
        if arrived_s - self._reported_s > SIGN_OF_LIFE_S or self._meter.is_frozen is not self._frozen:
            self._report()

    def _found(self, picture: Picture) -> tuple[list[Found], int | None]:
        """(detections of the detector and of the clicked spots, number of the picture if it is kept for clicks)."""
        if self._clicks is None:
            return self._detector.detect(picture.pixels), None
        self._count += 1
        self._clicks.begin(picture, self._count, frame_bytes(picture, [], self._count))
        found = self._detector.detect(picture.pixels)
        return self._clicks.found(picture, self._count) + found, self._count

    def _report(self) -> None:
        self._reported_s, self._frozen = time.monotonic(), self._meter.is_frozen
        state = VisionState("frozen", FROZEN) if self._frozen else VisionState("looking")
        self._daemon.report(msgspec.structs.replace(state, delivery=self._meter.report()))


if __name__ == "__main__":
    try:
        main()
    except BrokenPipeError:
        os._exit(0)
