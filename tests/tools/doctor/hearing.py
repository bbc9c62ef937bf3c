"""The service without sockets, in invented time, with its place in the network: what `check` would have heard."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import msgspec
from flying import CAMERA

from fwav_companion.camera import parse_calibration
from fwav_companion.config import parse
from fwav_companion.geometry.stamps import HostNs, whole_microseconds
from fwav_companion.pipeline.pipeline_factory import make_pipeline
from fwav_companion.service.network import make_node
from fwav_companion.tools.doctor.evidence import Board, Evidence, Files
from fwav_companion.tools.doctor.examine import examine
from fwav_companion.tools.doctor.finding import Finding
from fwav_companion.vision.wall_clock import WallClock
from fwav_companion.vision.wire import parse_frame
from sitl_mock import Options, simulate

AUTOPILOT = '[[link]]\nname = "autopilot"\nurl = "udpin://127.0.0.1:14540"\nrole = "autopilot"\n'
GROUND = '[[link]]\nname = "ground"\nurl = "udpout://127.0.0.1:14550"\nrole = "gcs"\n'
TEXT = AUTOPILOT + GROUND + '[camera]\ncalibration = "camera.yaml"\n'
SECONDS = 13.0

Wire = Callable[[bytes, int], list[bytes]]


class Hearing:
    """Flies with the mock for some seconds."""

    def __init__(
        self,
        settings: Sequence[str] = (),
        *,
        text: str = TEXT,
        key: bytes | None = None,
        on_the_way_in: Callable[[bytes], bytes] = lambda data: data,
        frame: Callable[[dict[str, Any]], dict[str, Any]] = lambda frame: frame,
        crossed: bool = False,
    ) -> None:
        """``on_the_way_in`` and ``frame`` are faults of the wire and of the detector; ``crossed``: RX on our own TX."""
        self.config = parse(text, "flight.toml", settings)
        self.calibration = parse_calibration(CAMERA, "camera.yaml")
        self._pipeline = make_pipeline(self.config, self.calibration, unix_offset_ns=0, live=True)
        self._node = make_node(self.config, key, 0)
        self._wall_clock = WallClock(HostNs(0), 0)
        self._on_the_way_in, self._frame, self._crossed = on_the_way_in, frame, crossed
        self._now = HostNs(0)
        self._came, self._came_ns = 0, HostNs(0)

    @property
    def wake_at(self) -> int | None:
        dues = [due for due in (self._pipeline.wake_at, self._node.wake_at) if due is not None]
        return min(dues, default=None)

    def on_wake(self, now_ns: int) -> list[bytes]:
        now = self._instant(now_ns)
        if self._node.wake_at is not None and self._node.wake_at <= now:
            self._node.on_wake(now)
        self._pipeline.advance(now)
        return self._flushed(now)

    def on_bytes(self, data: bytes, now_ns: int) -> list[bytes]:
        return self.hear("autopilot", self._on_the_way_in(data), now_ns)

    def hear(self, link: str, data: bytes, now_ns: int) -> list[bytes]:
        now = self._instant(now_ns)
        received = self._node.receive(link, data, now)
        for message in received.messages:
            self._pipeline.on_message(message, now)
        if received.rate_request:
            self._pipeline.on_rate_request_passed(received.rate_request, now)
        return [*(frame for name, frame in received.forwards if name == "autopilot"), *self._flushed(now)]

    def on_frame(self, frame: Mapping[str, Any], now_ns: int) -> list[bytes]:
        now = self._instant(now_ns)
        self._wall_clock.observe(now, now)
        self._came, self._came_ns = self._came + 1, now
        self._pipeline.on_frame(parse_frame(json.dumps(self._frame(dict(frame))), now, self._wall_clock), now)
        return self._flushed(now)

    def status(self) -> dict[str, Any]:
        """As the service writes it."""
        now = self._now
        age_s = (now - self._came_ns) / 1e9 if self._came else None
        status = {
            "links": {link.name: {"state": "up", "why": ""} for link in self.config.link},
            "traffic": msgspec.to_builtins(self._node.statistics(now)),
            "intake": {"came": self._came, "age_s": age_s, "why": ""},
            "internal_faults": 0,
            **self._pipeline.status(now),
        }
        return msgspec.json.decode(msgspec.json.encode(status))

    def _instant(self, now_ns: int) -> HostNs:
        self._now = HostNs(max(whole_microseconds(now_ns), self._now + 1000))
        return self._now

    def _flushed(self, now: HostNs) -> list[bytes]:
        self._node.adopt(self._pipeline.system)
        frames = [
            frame
            for outgoing in self._pipeline.take().messages
            for name, frame in self._node.encode(outgoing, now)
            if name == "autopilot"
        ]
        if self._crossed:
            for frame in frames:
                self._node.receive("autopilot", frame, now)
        return frames


def heard(options: Options, settings: Sequence[str] = (), **how: Any) -> Evidence:
    """What is known after some seconds with the mock."""
    hearing = Hearing(settings, **how)
    mock = simulate(options.but({"seconds": SECONDS}))
    for _ in mock.drive(hearing):
        pass
    return evidence_of(hearing)


def evidence_of(hearing: Hearing, board: Board | None = None) -> Evidence:
    """With a healthy board and a camera file."""
    return Evidence(
        config=hearing.config,
        board=board or Board(user="pilot"),
        files=Files(calibration=hearing.calibration),
        status=hearing.status(),
    )


def codes(findings: Sequence[Finding]) -> list[str]:
    """Their names, in their order."""
    return [finding.code for finding in findings]


def found(evidence: Evidence) -> list[str]:
    """What the doctor names."""
    return codes(examine(evidence))
