"""``python -m sitl_mock.eye``: the camera as a process of its own. Frames of the flight into a pipe, in real time.

A frame in the pipe is one line of JSON (``bytes``, ``size``, ``format``, the stamp, ``frame``, ``exposure_s``), then so
many bytes of grey levels, row by row. Frames are rendered ahead and leave when a camera would deliver them; one that is
not done in time, or that nobody takes in time, is left out, as a busy camera would.
"""

from __future__ import annotations

import argparse
import errno
import json
import os
import signal
import stat
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sitl_mock.arguments import (
    LONGEST_S,
    MISTAKES,
    SCENARIOS_TOLD,
    OneLineParser,
    add_flight_arguments,
    instant_ns,
    options_from,
    told,
)
from sitl_mock.simulate import Simulation

if TYPE_CHECKING:
    from sitl_mock.ground_picture import Picture
    from sitl_mock.render import Eye

AHEAD_S = 0.5
"""Rendered at most so long before it leaves."""
LATE_S = 0.15
"""A frame that would leave later than this is left out."""
WRITE_S = 0.1
"""So long may the reader take for one frame; a frame that was begun is always finished or the pipe is closed."""


def main(arguments: list[str] | None = None) -> int:
    """0 at the end of the flight or when told to stop; 2 for what cannot be understood or opened."""
    chosen = _parser().parse_args(arguments)
    try:
        simulation = Simulation(options_from(chosen, LONGEST_S), chosen.start_ns or time.monotonic_ns())
        from sitl_mock.render import Eye

        eye = Eye(simulation)
        if chosen.picture:
            _keep(eye.picture(chosen.frame), Path(chosen.picture))
        else:
            _run(simulation, eye, Path(chosen.pipe), chosen.truth)
    except MISTAKES as error:
        print(f"sitl_mock.eye: {told(error)}", file=sys.stderr)  # noqa: T201
        return 2
    return 0


def _run(simulation: Simulation, eye: Eye, path: Path, truth: str) -> None:
    signals: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda received, _frame: signals.append(received))
    pipe = FramePipe(path)
    with Path(truth or os.devnull).open("w", encoding="utf-8") as told:
        frame = 0
        while not signals and simulation.camera.due_ns(frame) <= simulation.end_ns:
            due_ns = simulation.camera.due_ns(frame)
            _sleep_until(due_ns - round(AHEAD_S * 1e9))
            left_out = time.monotonic_ns() > due_ns + LATE_S * 1e9
            if not left_out:
                picture = eye.picture(frame)
                _sleep_until(due_ns)
                left_out = not pipe.send(_header(simulation, frame, picture), picture.tobytes())
            told.write(json.dumps(_truth(simulation, eye, frame, delivered=not left_out)) + "\n")
            told.flush()
            frame += 1
    pipe.close()


def _header(simulation: Simulation, frame: int, picture: Picture) -> dict[str, Any]:
    height, width = picture.shape
    return {
        **simulation.camera.stamp(frame),
        "frame": frame,
        "size": [width, height],
        "exposure_s": simulation.options.camera.exposure_s,
        "format": "gray8",
        "bytes": width * height,
    }


def _truth(simulation: Simulation, eye: Eye, frame: int, *, delivered: bool) -> dict[str, Any]:
    tags = [view._asdict() for view in eye.views(frame)]
    return {
        "type": "picture",
        "frame": frame,
        "row0_s": simulation.camera.row0_s(frame),
        "delivered": delivered,
        "tags": [tag for tag in tags if simulation.camera.lens.sees(*tag["pixel"])],
    }


class FramePipe:
    """The writing end of a named pipe, which readers come to and leave as they like."""

    def __init__(self, path: Path) -> None:
        if not path.exists():
            os.mkfifo(path, 0o600)
        if not stat.S_ISFIFO(path.stat().st_mode):
            raise ValueError(f"{path} is no named pipe")
        self._path = path
        self._file: int | None = None

    def send(self, header: dict[str, Any], data: bytes) -> bool:
        """One frame; False where nobody takes it."""
        file = self._opened()
        if file is None:
            return False
        try:
            _write(file, json.dumps(header, separators=(",", ":")).encode() + b"\n" + data)
        except OSError:
            self.close()
            return False
        return True

    def close(self) -> None:
        """The reader sees the end."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def _opened(self) -> int | None:
        if self._file is None:
            try:
                self._file = os.open(self._path, os.O_WRONLY | os.O_NONBLOCK)
            except OSError as error:
                if error.errno != errno.ENXIO:  # nobody reads
                    raise
        return self._file


def _write(file: int, data: bytes) -> None:
    """Whole, or OSError and the pipe is given up: half a frame would spoil the next."""
    view, deadline = memoryview(data), time.monotonic() + WRITE_S
    while view:
        try:
            view = view[os.write(file, view) :]
        except BlockingIOError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.001)


def _keep(picture: Picture, path: Path) -> None:
    import cv2

    if not cv2.imwrite(str(path), picture):
        raise ValueError(f"{path}: no picture of this kind can be written")


def _sleep_until(at_ns: int) -> None:
    left_s = (at_ns - time.monotonic_ns()) * 1e-9
    if left_s > 0.0:
        time.sleep(left_s)


def _parser() -> argparse.ArgumentParser:
    parser = OneLineParser(
        prog="python -m sitl_mock.eye",
        description="The mock's camera: frames in real time into a named pipe, or one of them into a file.",
        epilog=f"{SCENARIOS_TOLD}\n\nexample:\n  python -m sitl_mock.eye --scenario demo --frame 60 --picture f.png",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--pipe", metavar="PATH", default="frames.pipe", help="made where it is not there; default %(default)s")
    add("--start-ns", type=instant_ns, default=0, help="when the flight begins on the monotonic clock; default: now")
    add("--truth", metavar="FILE", default="", help="what each frame shows, and whether it was delivered (.jsonl)")
    add("--picture", metavar="FILE", default="", help="no pipe: the one frame named by --frame, into an image file")
    add("--frame", type=int, default=0, help="for --picture")
    add_flight_arguments(parser)
    return parser


if __name__ == "__main__":
    sys.exit(main())
