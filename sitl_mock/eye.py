"""``python -m sitl_mock.eye``: the camera as a separate process that writes frames to a pipe in real time.

A frame in the pipe is one line of JSON (``bytes``, ``size``, ``format``, the stamp, ``frame``, ``exposure_s``), then
``bytes`` bytes of grey levels, row by row. Frames are rendered in advance and written when a camera would deliver them;
a frame that is not rendered in time, or that no reader takes in time, is dropped, as by a busy camera. This process
hears no messages: a copter that follows LANDING_TARGET (``land`` and its like) lands here as without it.
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
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sitl_mock.arguments import (
    LONGEST_S,
    MISTAKES,
    SCENARIO_LIST,
    OneLineParser,
    add_flight_arguments,
    instant_ns,
    message_for_user,
    options_from,
)
from sitl_mock.simulate import Simulation

if TYPE_CHECKING:
    from sitl_mock.ground_picture import Picture
    from sitl_mock.render import Eye

AHEAD_S = 0.5
"""Longest time between rendering and delivery of a frame, seconds."""
LATE_S = 0.15
"""Longest delay of a frame, seconds; a later one is dropped."""
WRITE_S = 0.1
"""Longest time for a reader to take one frame, seconds; a frame is written completely, or the pipe is closed."""


def main(arguments: list[str] | None = None) -> int:
    """Exit status: 0 at the end of the flight or after a stop signal; 2 for invalid arguments or an output that cannot
    be opened.
    """
    chosen = _parser().parse_args(arguments)
    try:
        simulation = Simulation(options_from(chosen, LONGEST_S), chosen.start_ns or time.monotonic_ns())
        from sitl_mock.render import Eye

        eye = Eye(simulation)
        if chosen.unpaced:
            _write_all(simulation, eye, chosen.frame)
        elif chosen.picture:
            _keep(eye.picture(chosen.frame), Path(chosen.picture))
        else:
            _run(simulation, eye, Path(chosen.pipe), chosen.truth)
    except MISTAKES as error:
        print(f"sitl_mock.eye: {message_for_user(error)}", file=sys.stderr)  # noqa: T201
        return 2
    return 0


def _write_all(simulation: Simulation, eye: Eye, frame: int) -> None:
    """Writes all frames from this one on to standard output, in the format of the pipe."""
    with suppress(BrokenPipeError):  # the reader has seen enough
        while simulation.camera.due_ns(frame) <= simulation.end_ns:
            picture = eye.picture(frame)
            header = json.dumps(_header(simulation, frame, picture)).encode() + b"\n"
            sys.stdout.buffer.write(header + picture.tobytes())
            sys.stdout.buffer.flush()
            frame += 1


def _run(simulation: Simulation, eye: Eye, path: Path, truth: str) -> None:
    signals: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda received, _frame: signals.append(received))
    pipe = FramePipe(path)
    with Path(truth or os.devnull).open("w", encoding="utf-8") as truth_file:
        frame = 0
        while not signals and simulation.camera.due_ns(frame) <= simulation.end_ns:
            due_ns = simulation.camera.due_ns(frame)
            _sleep_until(due_ns - round(AHEAD_S * 1e9))
            left_out = time.monotonic_ns() > due_ns + LATE_S * 1e9
            if not left_out:
                picture = eye.picture(frame)
                _sleep_until(due_ns)
                left_out = not pipe.send(_header(simulation, frame, picture), picture.tobytes())
            truth_file.write(json.dumps(_truth(simulation, eye, frame, delivered=not left_out)) + "\n")
            truth_file.flush()
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
    """Writing end of a named pipe; readers may open and close the other end at any time."""

    def __init__(self, path: Path) -> None:
        if not path.exists():
            os.mkfifo(path, 0o600)
        if not stat.S_ISFIFO(path.stat().st_mode):
            raise ValueError(f"{path} is not a named pipe")
        self._path = path
        self._file: int | None = None

    def send(self, header: dict[str, Any], data: bytes) -> bool:
        """Writes one frame; False where no reader takes it."""
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
        """Closes the pipe; the reader sees the end of the file."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def _opened(self) -> int | None:
        if self._file is None:
            try:
                self._file = os.open(self._path, os.O_WRONLY | os.O_NONBLOCK)
            except OSError as error:
                if error.errno != errno.ENXIO:  # no reader
                    raise
        return self._file


def _write(file: int, data: bytes) -> None:
    """Writes all bytes, or raises OSError and the pipe is closed: half a frame would corrupt the next."""
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
        raise ValueError(f"{path}: this image format cannot be written")


def _sleep_until(at_ns: int) -> None:
    left_s = (at_ns - time.monotonic_ns()) * 1e-9
    if left_s > 0.0:
        time.sleep(left_s)


def _parser() -> argparse.ArgumentParser:
    parser = OneLineParser(
        prog="python -m sitl_mock.eye",
        description="The mock's camera: writes frames in real time to a named pipe, or one frame to a file.",
        epilog=f"{SCENARIO_LIST}\n\nexample:\n  python -m sitl_mock.eye --scenario demo --frame 60 --picture f.png",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--pipe", metavar="PATH", default="frames.pipe", help="named pipe, created if missing; default %(default)s")
    add(
        "--start-ns",
        type=instant_ns,
        default=0,
        help="start of the flight on the host's monotonic clock, nanoseconds; default: now",
    )
    add(
        "--truth",
        metavar="FILE",
        default="",
        help="write the truth about each frame, and whether it was delivered (.jsonl)",
    )
    add("--picture", metavar="FILE", default="", help="write the frame --frame to an image file, without a pipe")
    add("--unpaced", action="store_true", help="write all frames from --frame on to standard output, without a clock")
    add("--frame", type=int, default=0, help="frame number for --picture, or the first; default %(default)s")
    add_flight_arguments(parser)
    return parser


if __name__ == "__main__":
    sys.exit(main())
