"""Runs an example sender as a program, up to the first datagram that it sends."""

import json
import runpy
import socket
import sys
from pathlib import Path

from fwav_companion.types import Frame
from fwav_companion.vision.frame_receiver import read_clocks
from fwav_companion.vision.wall_clock import WallClock
from fwav_companion.vision.wire import parse_frame

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
SHOWN = (100.0, 60.0, 140.0, 180.0)
"""Left, top, right, bottom of the one object, edges of pixels: the middle is the pixel (119.5, 119.5)."""


class Sent(Exception):  # noqa: N818
    """The first datagram: it ends the program."""


class Sender:
    """A socket of datagrams that sends nothing."""

    def __init__(self, family, kind):
        assert (family, kind) == (socket.AF_INET, socket.SOCK_DGRAM)

    def sendto(self, data, address):
        assert address == ("127.0.0.1", 14601)
        raise Sent(data)


def first_sent(monkeypatch, name, *words):
    """The first frame that an adapter sends, as the companion reads it, and its age in seconds."""
    with monkeypatch.context() as patched:
        patched.setattr(socket, "socket", Sender)
        patched.setattr(sys, "argv", [name, *words])
        try:
            runpy.run_path(str(EXAMPLES / f"detections_of_{name}.py"), run_name="__main__")
        except Sent as sent:
            return arrived(sent.args[0])
    raise AssertionError("nothing was sent")


def arrived(data):
    """The frame as the companion reads it, and its age in seconds."""
    arrival_ns, unix_ns = read_clocks()
    frame = parse_frame(data, arrival_ns, WallClock(arrival_ns, unix_ns))
    assert isinstance(frame, Frame)
    return frame, (arrival_ns - frame.stamp_ns) / 1e9


def message(example_name, function, *words):
    """What a function of an adapter returns, as text."""
    return json.dumps(runpy.run_path(str(EXAMPLES / f"detections_of_{example_name}.py"))[function](*words))
