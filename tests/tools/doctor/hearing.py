"""The service without sockets, in invented time, as a node of the network: the messages that `check` would receive."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import msgspec
from configured_links import AUTOPILOT, GROUND
from flying import CAMERA
from kept import kept

from fwav_companion.camera import parse_calibration
from fwav_companion.config import parse
from fwav_companion.geometry.stamps import HostNs, whole_microseconds
from fwav_companion.pipeline.pipeline_factory import make_pipeline
from fwav_companion.service.network import make_node
from fwav_companion.tools.doctor.evidence import Board, Evidence, Files
from fwav_companion.tools.doctor.examination import examine
from fwav_companion.tools.doctor.finding import Finding
from fwav_companion.tools.doctor.run_status import run_status
from fwav_companion.types import Outgoing
from fwav_companion.types.network_status import LinkReport
from fwav_companion.types.status import IntakeReport, RunStatus
from fwav_companion.vision.wall_clock import WallClock
from fwav_companion.vision.wire import parse_frame
from sitl_mock import Options, simulate

TEXT = AUTOPILOT + GROUND + '[camera]\ncalibration = "camera.yaml"\n'
SECONDS = 10.0

Wire = Callable[[bytes, int], list[bytes]]


class Hearing:
    """Runs against the mock for some seconds."""

    def __init__(
        self,
        settings: Sequence[str] = (),
        *,
        text: str = TEXT,
        key: bytes | None = None,
        on_the_way_in: Callable[[bytes], bytes] = lambda data: data,
        frame: Callable[[dict[str, Any]], dict[str, Any]] = lambda frame: frame,
        crossed: bool = False,
        ignored: bool = False,
    ) -> None:
        """``on_the_way_in`` and ``frame`` are faults of the wire and of the detector; ``crossed``: our RX is wired to
        our own TX; ``ignored``: the autopilot drops what this service sends.
        """
        self.config = parse(text, "flight.toml", settings)
        self.calibration = parse_calibration(CAMERA, "camera.yaml")
        self._pipeline = make_pipeline(self.config, self.calibration, unix_offset_ns=0, live=True)
        self._node = make_node(self.config, key, 0)
        self._wall_clock = WallClock(HostNs(0), 0)
        self._on_the_way_in, self._frame, self._crossed, self._ignored = on_the_way_in, frame, crossed, ignored
        self._now = HostNs(0)
        self._started_ns: HostNs | None = None
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
        followed = self._pipeline.on_rate_requests(received.rate_requests, self._node.demanded, now)
        passed = [frame for name, frame in received.forwards if name == "autopilot"]
        return [*passed, *self._to_autopilot(followed, now), *self._flushed(now)]

    def on_frame(self, frame: Mapping[str, Any], now_ns: int) -> list[bytes]:
        now = self._instant(now_ns)
        self._wall_clock.observe(now, now)
        self._came, self._came_ns = self._came + 1, now
        self._pipeline.on_frame(parse_frame(json.dumps(self._frame(dict(frame))), now, self._wall_clock), now)
        return self._flushed(now)

    def status(self) -> dict[str, Any]:
        """The status as the service writes it."""
        now = self._now
        age_s = (now - self._came_ns) / 1e9 if self._came else None
        status = RunStatus(
            **msgspec.structs.asdict(self._pipeline.status(now)),
            up_s=(now - (self._started_ns or 0)) / 1e9,
            links={link.name: LinkReport(state="up") for link in self.config.link},
            traffic=self._node.statistics(now),
            intake=IntakeReport(came=self._came, age_s=age_s),
        )
        return msgspec.json.decode(msgspec.json.encode(status))

    def _instant(self, now_ns: int) -> HostNs:
        self._now = HostNs(max(whole_microseconds(now_ns), self._now + 1000))
        self._started_ns = self._now if self._started_ns is None else self._started_ns
        return self._now

    def _flushed(self, now: HostNs) -> list[bytes]:
        identity = self._pipeline.identity
        self._node.adopt(identity.system, identity.autopilot_component, vehicle=identity.vehicle)
        self._node.share(self._pipeline.own_streams)
        frames = self._to_autopilot(self._pipeline.take().messages, now)
        if self._crossed:
            for frame in frames:
                self._node.receive("autopilot", frame, now)
        return [] if self._ignored else frames

    def _to_autopilot(self, messages: Sequence[Outgoing], now: HostNs) -> list[bytes]:
        return [
            frame for outgoing in messages for name, frame in self._node.encode(outgoing, now) if name == "autopilot"
        ]


def flown(options: Options, settings: Sequence[str] = (), *, seconds: float = SECONDS, **how: Any) -> Hearing:
    """The service after some seconds with the mock."""
    hearing = Hearing(settings, **how)
    for _ in simulate(options.but({"seconds": seconds})).drive(hearing):
        pass
    return hearing


def heard(options: Options, settings: Sequence[str] = (), **how: Any) -> Evidence:
    """The evidence after some seconds with the mock; the same flight is flown once in a run."""

    def fly() -> Evidence:
        return evidence_of(flown(options, settings, **how))

    if any(callable(each) for each in how.values()):
        return fly()
    return kept(f"evidence of {options!r} {tuple(settings)!r} {sorted(how.items())!r}", fly)


def silent(text: str = TEXT) -> Evidence:
    """The evidence after some seconds in which nothing arrives."""
    hearing = Hearing(text=text)
    for second in range(round(SECONDS)):
        hearing.on_wake(second * 10**9)
    return evidence_of(hearing)


def evidence_of(hearing: Hearing, board: Board | None = None) -> Evidence:
    """The evidence with a healthy board and a camera file."""
    return Evidence(
        config=hearing.config,
        board=board or Board(user="pilot"),
        files=Files(calibration=hearing.calibration),
        status=run_status(hearing.status()),
    )


def codes(findings: Sequence[Finding]) -> list[str]:
    """The codes of the root findings, in their order."""
    return [finding.code for finding in findings]


def consequences(finding: Finding) -> set[str]:
    """The codes of everything that follows from a finding."""
    return {each.code for each in finding.walk()} - {finding.code}


def found(evidence: Evidence) -> list[str]:
    """The codes of what `check` reports, without consequences."""
    return codes(examine(evidence))
