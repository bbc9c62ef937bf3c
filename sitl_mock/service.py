"""``python -m sitl_mock --serve``: a process that flies one flight after the other in simulated time.

A request is one line of JSON on stdin, a reply one line of JSON on stdout, then the bytes that it announces::

    {"scenario": "default", "set": {"seed": 3, "flight.height_m": 15.0}, "rates_hz": {"ATTITUDE_QUATERNION": 100}}
    {"format": 1, "telemetry": 812345, "detections": 345678, "truth_csv": 81, "frames": 1798, "in_view": 611,
     "biases": {"heading_deg": 1.2, ...}}

``set`` has the keys of ``--set``, and ``targets``, a list of objects with the keys of a target. ``rates_hz`` are the
message rates that the recording companion requests; without it, those of ``--record``. Behind the reply's line follow
a .tlog, detections in JSON lines and the truth as CSV, of the announced numbers of bytes: what ``--record`` writes.
``frames`` counts the pictures, ``in_view`` those with a target in view. A request that cannot be flown is answered by
``{"error": "..."}`` alone. The process ends with its stdin.
"""

from __future__ import annotations

import contextlib
import dataclasses
import gc
import json
from io import BytesIO, StringIO
from typing import Any, BinaryIO

from sitl_mock import truth
from sitl_mock.arguments import MISTAKES, message_for_user, with_settings
from sitl_mock.camera import FrameTruth
from sitl_mock.options import Options
from sitl_mock.outputs import DetectionLines
from sitl_mock.recording import Recorded
from sitl_mock.scenarios import scenario
from sitl_mock.simulate import Event

FORMAT = 1
NEW_BEFORE_A_SEARCH = 20_000
"""New containers before a search for garbage, instead of Python's 700."""


def serve(requests: BinaryIO, replies: BinaryIO) -> None:
    """Answers requests until they end, or until no client reads the replies."""
    with contextlib.suppress(BrokenPipeError):
        _serve(requests, replies)


def spare_garbage_collection() -> None:
    """Excludes what is loaded from searches for garbage, and makes these rare: they took 5 % of a flight."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(NEW_BEFORE_A_SEARCH)


def _serve(requests: BinaryIO, replies: BinaryIO) -> None:
    for line in requests:
        try:
            header, parts = _reply(json.loads(line))
        except (*MISTAKES, AttributeError, TypeError) as error:
            header, parts = {"error": message_for_user(error)}, []
        replies.write(json.dumps(header, separators=(",", ":")).encode() + b"\n")
        replies.writelines(parts)
        replies.flush()


def _reply(request: dict[str, Any]) -> tuple[dict[str, Any], list[bytes]]:
    """The reply's line, and the files that follow it."""
    options = with_settings(scenario(request.get("scenario", "default")), request.get("set", {}))
    return flown_files(options, request.get("rates_hz"))


def flown_files(options: Options, rates_hz: dict[str, float] | None = None) -> tuple[dict[str, Any], list[bytes]]:
    """One flight: its counts and drawn errors, and the contents of its files."""
    tlog, detections, in_view = BytesIO(), StringIO(), 0

    def count(event: Event) -> None:
        nonlocal in_view
        in_view += isinstance(event[1], FrameTruth) and bool(event[1].visible)

    simulation = Recorded(options, tlog)
    simulation.fly(DetectionLines(detections, simulation.unix_minus_host_s), count, rates_hz)
    files = [
        tlog.getvalue(),
        detections.getvalue().encode(),
        truth.csv_text(simulation, simulation.options.seconds).encode(),
    ]
    header = {
        "format": FORMAT,
        **dict(zip(("telemetry", "detections", "truth_csv"), map(len, files), strict=True)),
        "frames": simulation.frames,
        "in_view": in_view,
        "biases": dataclasses.asdict(simulation.biases),
    }
    return header, files
