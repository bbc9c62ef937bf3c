"""Calls of Python functions for one attitude and for one frame: a measure that neither load nor caches move.

A flight of the mock is recorded, and processed again with a counter: bytes of the autopilot's link through the node and
the pipeline, as the daemon does it, without its sockets. Only functions written in Python count.
``python -m tests.benchmarks.calls``
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable
from types import FrameType
from typing import Any, NamedTuple, TypeVar

from fwav_companion.camera import parse_calibration
from fwav_companion.config import Config, parse
from fwav_companion.geometry.stamps import HostNs, whole_microseconds
from fwav_companion.mavlink.router.node import Node
from fwav_companion.mavlink.wire.scanner import Scanner
from fwav_companion.pipeline.pipeline import Pipeline
from fwav_companion.pipeline.pipeline_factory import make_pipeline
from fwav_companion.service.network import make_node
from fwav_companion.vision.wall_clock import WallClock
from fwav_companion.vision.wire import parse_frame
from sitl_mock import scenario, simulate
from tests.benchmarks.figure import Figure

SETTLED_S = 12.0
"""Adoption, clock, rates, and a confirmed track; the counts begin then."""
COUNTED_S = 8.0
ATTITUDE_BUDGET = 70.0
"""At 100 Hz, from the bytes to the timer's next instant."""
FRAME_BUDGET = 408.0
"""As measured (407): a change that adds to it is seen."""
Result = TypeVar("Result")
CAMERA = """
model: kannala_brandt
image_size: [640, 480]
k_mm: [3.55, 0.03, 0.0, 0.0, 0.0]
pixels_per_mm: [188.0, 188.0]
principal_point: [320.0, 240.0]
"""
CONFIGURATION = """
[[link]]
name = "autopilot"
url = "udpin://127.0.0.1:14540"
role = "autopilot"
[camera]
calibration = "camera.yaml"
[tracking]
self_calibration = false
[vehicle]
attitude_message = "ATTITUDE"
"""


class Calls(NamedTuple):
    """Calls of functions in one piece of work."""

    python: int
    """Of functions written in Python."""
    native: int
    """Of functions written in C."""


class CallCounter:
    """Counts the calls of functions while a piece of work is done."""

    def __init__(self) -> None:
        self.by_function: Counter[str] = Counter()
        """Calls since the start by function; those written in C begin with "C:"."""

    def counted(self, work: Callable[[], Result]) -> tuple[Result, Calls]:
        """Do the work; returns its result and its calls."""
        before = self._calls()
        sys.setprofile(self._on_event)
        try:
            result = work()
        finally:
            sys.setprofile(None)
        after = self._calls()
        # The work itself and the end of profiling are no part of it.
        return result, Calls(after.python - before.python - 1, after.native - before.native - 1)

    def _calls(self) -> Calls:
        native = sum(count for name, count in self.by_function.items() if name.startswith("C:"))
        return Calls(self.by_function.total() - native, native)

    def _on_event(self, frame: FrameType, event: str, argument: Any) -> None:
        if event == "call":
            code = frame.f_code
            self.by_function[f"{code.co_filename.rpartition('fwav_companion/')[2]}:{code.co_qualname}"] += 1
        elif event == "c_call":
            self.by_function[f"C:{argument.__qualname__}"] += 1


class Service:
    """The daemon's way from bytes and frames to messages, without sockets, files and timers."""

    def __init__(self, unix_minus_host_s: float) -> None:
        self.counter = CallCounter()
        self.calls: dict[str, list[Calls]] = {"ATTITUDE": [], "frame": []}
        """Calls of each datagram with one attitude alone, and of each frame, while counting."""
        self.counts_from_ns: int | None = None
        self.config: Config = parse(CONFIGURATION, "flight.toml")
        self._offset_ns = round(unix_minus_host_s * 1e6) * 1000
        calibration = parse_calibration(CAMERA, "camera.yaml")
        self.pipeline: Pipeline = make_pipeline(
            self.config, calibration, unix_offset_ns=self._offset_ns, live=True, sightings=False
        )
        self._node: Node = make_node(self.config, None, 0)
        self._scanner = Scanner(datagrams=True)
        self._node.link_up("autopilot")
        self.wall_clock = WallClock(HostNs(0), self._offset_ns)
        self._now = HostNs(0)

    @property
    def now(self) -> int:
        return self._now

    @property
    def wake_at(self) -> int | None:
        return self.pipeline.wake_at

    def on_wake(self, now_ns: int) -> list[bytes]:
        now = self._instant(now_ns)
        self.pipeline.advance(now)
        return self._flushed(now)

    def on_bytes(self, data: bytes, now_ns: int) -> list[bytes]:
        now = self._instant(now_ns)
        names = {frame.definition.name for frame in self._scanner.feed(data) if frame.definition is not None}
        (sent, waited), calls = self._counted(lambda: self._take(data, now), now)
        if names == {"ATTITUDE"} and calls and not sent and not waited:
            self.calls["ATTITUDE"].append(calls)
        return sent

    def on_frame(self, frame: Any, now_ns: int) -> list[bytes]:
        now = self._instant(now_ns)
        self.wall_clock.observe(now, now + self._offset_ns)
        parsed = parse_frame(json.dumps(frame), now, self.wall_clock)
        sent, calls = self._counted(lambda: self._take_frame(parsed, now), now)
        if calls:
            self.calls["frame"].append(calls)
        return sent

    def _counted(self, work: Callable[[], Result], now: int) -> tuple[Result, Calls | None]:
        if self.counts_from_ns is None or now < self.counts_from_ns:
            return work(), None
        return self.counter.counted(work)

    def _take(self, data: bytes, now: HostNs) -> tuple[list[bytes], bool]:
        """Returns our frames, and whether something else was due."""
        received = self._node.receive("autopilot", data, now)
        due = self.pipeline.wake_at
        waited = due is not None and due <= now
        if waited:
            self.pipeline.advance(now)
        for message in received.messages:
            self.pipeline.on_message(message, now)
        return self._flushed(now), waited

    def _take_frame(self, frame: Any, now: HostNs) -> list[bytes]:
        self.pipeline.on_frame(frame, now)
        return self._flushed(now)

    def _flushed(self, now: HostNs) -> list[bytes]:
        sent = self._outputs(now) if self.pipeline.has_outputs else []
        self._due = (self.pipeline.wake_at, self._node.wake_at)  # as the daemon does, to set its timer
        return sent

    def _outputs(self, now: HostNs) -> list[bytes]:
        outputs = self.pipeline.take()
        identity = self.pipeline.identity
        self._node.adopt(identity.system, identity.autopilot_component, vehicle=identity.vehicle)
        self._node.share(self.pipeline.own_streams)
        return [data for message in outputs.messages for _, data in self._node.encode(message, now)]

    def _instant(self, now_ns: int) -> HostNs:
        self._now = HostNs(max(whole_microseconds(now_ns), self._now + 1000))
        return self._now


def fly() -> Service:
    """The service after a flight of the mock, with its counts."""
    mock = simulate(scenario("nadir").but({"seconds": SETTLED_S + COUNTED_S, "seed": 3}))
    service = Service(mock.unix_minus_host_s)
    for _ in mock.drive(service):
        if service.counts_from_ns is None:
            service.counts_from_ns = service.now + round(SETTLED_S * 1e9)
    return service


def measure() -> list[Figure]:
    """One flight, about ten seconds."""
    calls = fly().calls
    return [
        _figure("Python calls for one ATTITUDE", calls["ATTITUDE"], ATTITUDE_BUDGET),
        _figure("Python calls for one frame of one target", calls["frame"], FRAME_BUDGET),
    ]


def _figure(name: str, calls: list[Calls], budget: float) -> Figure:
    python, native = (sum(column) / len(calls) for column in zip(*calls, strict=True))
    return Figure(name, python, budget, False, f"mean of {len(calls)}; {native:.0f} more of functions written in C")


if __name__ == "__main__":
    print(*measure(), sep="\n")
