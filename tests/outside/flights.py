"""Flights with the mock that produce every line, message and status of the pipeline: the adapter of these tests.

Time is invented, so each flight gives the same outputs in every run: the lines of its targets file, the detections of
its recording, and its MAVLink messages.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import Any

import msgspec
from flying import Companion
from kept import kept
from mavlink_wire import Wire

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.types import BoardReport, Frame
from fwav_companion.vision.wall_clock import WallClock
from fwav_companion.vision.wire import parse_frame
from sitl_mock import scenario, simulate

STATION = (255, 190)
LANDING = (
    "publish.landing_target=true",
    'publish.landing_label="target"',
    "publish.landing_max_sigma_m=5.0",
)
SHOWN = ("publish.adsb=true", 'publish.video_uri="rtsp://10.0.0.1/eye"', 'publish.cot="udpout://127.0.0.1:6969"')

MESSAGE_IDS = (148, 259, 260, 262, 269, 270, 275, 276, 285)
ASKED: tuple[tuple[int, tuple[float, ...]], ...] = (
    *((512, (float(message_id),)) for message_id in MESSAGE_IDS),
    (520, (1,)),
    (521, (1,)),
    (522, (1,)),
    (527, (1,)),
    (2504, (0,)),
    (2505, (0,)),
    (510, (275,)),
    (510, (30,)),
    (511, (275, 500_000)),
    (511, (276, 500_000)),
    (511, (276, 0)),
    (511, (276, -1)),
    (511, (30, 10_000)),
    (2004, (0.5, 0.5, 1.0)),
    (2004, (0.01, 0.01, 0.0)),
    (2004, (1.5, 0.5, 0.0)),
    (2005, (0.0, 0.0, 1.0, 1.0)),
    (2010, ()),
    (400, (1,)),
)
"""Commands of ground stations: (MAV_CMD, parameters)."""
TO_COMPONENTS = (100, 191)
FIRST_COMMAND_FRAME, FRAMES_BETWEEN = 200, 3


class Observed(Companion):
    """The service without sockets, with a ground station that sends every command."""

    def __init__(self, *words: Any, alter: Callable[[int, dict[str, Any]], dict[str, Any]], **how: Any) -> None:
        super().__init__(*words, **how)
        self._alter, self._frames = alter, 0
        self._station = Wire(*STATION)
        self._commands = [(component, *asked) for component in TO_COMPONENTS for asked in ASKED]
        self.answers: list[tuple[int, int, tuple[float, ...], list[Any]]] = []
        self.datagrams: list[bytes] = []
        self._take, self.pipeline.take = self.pipeline.take, self._taken

    def __getstate__(self) -> dict[str, Any]:
        """Everything but what only flies it."""
        return {name: value for name, value in super().__getstate__().items() if name not in ("_alter", "_station")}

    @property
    def now(self) -> Any:
        """The last instant of the flight."""
        return self._now

    def _taken(self) -> Any:
        outputs = self._take()
        self.datagrams += outputs.datagrams
        return outputs

    def on_frame(self, frame: Mapping[str, Any], now_ns: int) -> list[bytes]:
        frames = super().on_frame(self._alter(self._frames, dict(frame)), now_ns)
        self._frames += 1
        asked = self._frames - FIRST_COMMAND_FRAME
        if asked == 0:
            self.pipeline.on_board(BoardReport(), self._instant(now_ns))
            frames += self.on_bytes(self._station.frame("PING", 1, 1, 0, 0), now_ns)
        elif asked > 0 and asked % FRAMES_BETWEEN == 0 and self._commands:
            frames += self._asked(*self._commands.pop(0), now_ns)
        return frames

    def _asked(self, component: int, number: int, params: tuple[float, ...], now_ns: int) -> list[bytes]:
        padded = [*params, *[0.0] * (7 - len(params))]
        before = len(self.sent)
        frames = self.on_bytes(self._station.frame("COMMAND_LONG", 1, component, number, 0, *padded), now_ns)
        answer = [message for _, message in self.sent[before:] if message.component == component]
        self.answers.append((component, number, params, answer))
        return frames


def _flown(
    name: str,
    seconds: float,
    settings: Sequence[str] = (),
    changes: Mapping[str, Any] | None = None,
    alter: Callable[[int, dict[str, Any]], dict[str, Any]] = lambda _number, frame: frame,
) -> Observed:
    """A copy of the flight, which is flown once in a run of the tests."""

    def fly() -> Observed:
        mock = simulate(scenario(name).but({"seconds": seconds, **(changes or {})}))
        companion = Observed(settings, unix_minus_host_s=mock.unix_minus_host_s, sightings=True, alter=alter)
        for _ in mock.drive(companion):
            pass
        companion.finish()
        return companion

    return kept(repr(("outside", name, seconds, settings, changes, alter.__qualname__)), fly)


def _two_that_are_one(number: int, frame: dict[str, Any]) -> dict[str, Any]:
    """A detector that reports one target twice for some seconds, and then once."""
    if number > 0 and number < 240:
        frame["detections"] = [
            {**seen, "u": seen["u"] + shift} for seen in frame["detections"] for shift in (-25.0, 25.0)
        ]
    return frame


@cache
def flights() -> tuple[Observed, ...]:
    """All flights; together they show every line, key and message."""
    return (
        _flown("default", 20.0, (*LANDING, *SHOWN)),
        _flown("px4", 8.0, LANDING),
        _flown("old_rates", 6.0),
        _flown("home_moves", 12.0),
        _flown("late_gps", 24.0),
        _flown("walker", 8.0, ('tracking.motion="moving"',)),
        _flown("upside_down", 24.0, ("tracking.self_calibration=true",)),
        _flown(
            "gimbal",
            6.0,
            ("camera.mount.gimbal_device_id=154", "camera.mount.pitch_deg=0.0"),
            {"gimbal.device_id": 154},
        ),
        _flown("unbiased", 20.0, alter=_two_that_are_one),
        *(_flown("unbiased", 5.0, (f'ground.model="{model}"',)) for model in ("fixed", "rangefinder", "terrain")),
    )


def target_lines() -> Iterator[dict[str, Any]]:
    """Every line of every flight's targets file, decoded."""
    for flight in flights():
        yield from map(json.loads, flight.targets_file().splitlines())


def statuses() -> list[dict[str, Any]]:
    """The part of the status file that comes from the pipeline, at the end of each flight."""
    return [json.loads(msgspec.json.encode(flight.pipeline.status(flight.now))) for flight in flights()]


def dropped_for(line: Mapping[str, Any]) -> str:
    """The reason why a detector's line is refused; "" where it is taken."""
    now = HostNs(1_000_000_000_000)
    parsed = parse_frame(json.dumps(line), now, WallClock(now, 0))
    return "" if isinstance(parsed, Frame) else parsed.reason.value


def detection_lines() -> Iterator[dict[str, Any]]:
    """Every line of every flight's recorded detections."""
    for flight in flights():
        yield from map(json.loads, bytes(flight.detections).splitlines())
