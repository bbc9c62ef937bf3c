"""``python -m fwav_companion.vision.worker FD TASK``: a camera and a detector in a process of their own.

It sends detections over the inherited socket in the wire format, and its state in between. A camera that hangs blocks
this process and not the daemon, which then ends it and starts another.
"""

from __future__ import annotations

import os
import socket
import sys
import threading
import time
from contextlib import closing, suppress
from pathlib import Path

import cv2
import msgspec

from fwav_companion.vision.detectors import make_detector
from fwav_companion.vision.images import Detector, Picture, SourceEndedError, SourceLostError
from fwav_companion.vision.sources import open_source
from fwav_companion.vision.task import VisionState, VisionTask
from fwav_companion.vision.wire import MAX_DETECTIONS

SIGN_OF_LIFE_S = 2.0
"""Longest time between two messages while nothing hangs."""
OOM_SCORE = "800"
"""oom_score_adj of this process, of 1000 (proc(5)); the daemon has 0."""
RETRY_S = 1.0
"""Interval of attempts to open a missing source: a camera may be plugged in late."""

_encode = msgspec.json.Encoder().encode


def main() -> None:
    """Detect until the daemon closes its end of the socket."""
    _offer_to_oom_killer()
    daemon = socket.socket(fileno=int(sys.argv[1]))
    task = msgspec.json.decode(sys.argv[2], type=VisionTask)
    threading.Thread(target=_end_with, args=(daemon,), daemon=True).start()
    cv2.setNumThreads(1)  # one core of a small board for pictures, the others for the flight
    detector = make_detector(task)
    while True:
        try:
            _look(daemon, task.source, detector)
        except SourceLostError as error:
            _tell(daemon, VisionState("lost", str(error)))
            time.sleep(RETRY_S)
        except SourceEndedError as error:
            while True:
                _tell(daemon, VisionState("ended", str(error)))
                time.sleep(SIGN_OF_LIFE_S)


def _offer_to_oom_killer() -> None:
    """Let the kernel end this process before any other of the service when memory is short: the daemon restarts it."""
    with suppress(OSError):  # not on every system
        Path("/proc/self/oom_score_adj").write_text(OOM_SCORE)


def frame_bytes(picture: Picture, detector: Detector) -> bytes:
    """The detections of a picture in the wire format."""
    height, width = picture.pixels.shape[:2]
    frame = {**picture.stamp, "size": [width, height], "detections": detector.detect(picture.pixels)[:MAX_DETECTIONS]}
    if picture.number is not None:
        frame["frame"] = picture.number
    if picture.exposure_s is not None:
        frame["exposure_s"] = picture.exposure_s
    return _encode(frame)


def _look(daemon: socket.socket, text: str, detector: Detector) -> None:
    """Detect until the source is lost or ends."""
    with closing(open_source(text)) as source:
        while True:
            picture = source.read(SIGN_OF_LIFE_S)
            if picture is None:
                _tell(daemon, VisionState("looking"))
            else:
                daemon.send(frame_bytes(picture, detector))


def _tell(daemon: socket.socket, state: VisionState) -> None:
    daemon.send(_encode(state))


def _end_with(daemon: socket.socket) -> None:
    """End this process with the daemon: the daemon sends nothing, so a read returns when it has ended in any way."""
    try:
        daemon.recv(1)
    finally:
        os._exit(0)


if __name__ == "__main__":
    try:
        main()
    except BrokenPipeError:
        os._exit(0)
