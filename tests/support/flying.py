"""A companion that flies with the mock in invented time: the whole pipeline without sockets, clock or sleep."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import hypot
from typing import Any

import numpy as np
from configured_links import AUTOPILOT
from kept import kept

from fwav_companion.camera import parse_calibration
from fwav_companion.config import parse
from fwav_companion.geometry.stamps import HostNs, whole_microseconds
from fwav_companion.localization import ElevationTile
from fwav_companion.mavlink.wire.codec import Encoder, decode
from fwav_companion.mavlink.wire.scanner import Scanner
from fwav_companion.pipeline.pipeline import Pipeline
from fwav_companion.pipeline.pipeline_factory import WANTED, make_pipeline
from fwav_companion.recording.events import end_line, refused_line
from fwav_companion.recording.line_types import Line, TargetLine
from fwav_companion.recording.lines import encode_line
from fwav_companion.recording.tlog import tlog_record
from fwav_companion.tracking.smoothed.solve_jobs import SmootherOptions
from fwav_companion.types import Frame, NoticeCode, Outgoing
from fwav_companion.vision.wall_clock import WallClock
from fwav_companion.vision.wire import encode_frame, parse_frame
from sitl_mock import Options, Simulation, simulate

CAMERA = """
model: kannala_brandt
image_size: [640, 480]
k_mm: [3.55, 0.03, 0.0, 0.0, 0.0]
pixels_per_mm: [188.0, 188.0]
principal_point: [320.0, 240.0]
"""
LINK = AUTOPILOT


class Companion:
    """The service without its sockets; keeps its outputs and a recording as the service makes it."""

    def __init__(
        self,
        settings: Sequence[str] = (),
        *,
        unix_minus_host_s: float = 0.0,
        sightings: bool = False,
        wall_steps: Sequence[tuple[int, float]] = (),
        text: str = LINK + '[camera]\ncalibration = "camera.yaml"\n',
        elevation: Sequence[ElevationTile] = (),
        smoother: SmootherOptions | None = None,
        camera: str = CAMERA,
    ) -> None:
        """``wall_steps``: (host ns, seconds) of steps of this board's wall clock. ``text``: TOML. ``camera``: YAML."""
        self.config = parse(text, "flight.toml", settings)
        self.calibration = parse_calibration(camera, "camera.yaml")
        self.unix_offset_ns = round(unix_minus_host_s * 1e6) * 1000
        self.pipeline: Pipeline = make_pipeline(
            self.config,
            self.calibration,
            unix_offset_ns=self.unix_offset_ns,
            live=True,
            sightings=sightings,
            elevation=elevation,
            smoother=smoother,
        )
        self.wall_clock = WallClock(HostNs(0), self.unix_offset_ns)
        self._wall_steps = wall_steps
        self.lines: list[Line] = []
        self.sent: list[tuple[HostNs, Outgoing]] = []
        self.notices: list[str] = []
        """Texts of the notices, for the log."""
        self.codes: list[NoticeCode] = []
        """Their codes, in the same order."""
        self.tlog = bytearray()
        self.detections = bytearray()
        self._scanner = Scanner()
        self._encoders: dict[tuple[int, int], Encoder] = {}
        self._now = HostNs(0)

    @property
    def wake_at(self) -> int | None:
        return self.pipeline.wake_at

    def on_wake(self, now_ns: int) -> list[bytes]:
        now = self._instant(now_ns)
        self.pipeline.advance(now)
        return self._flushed(now)

    def on_bytes(self, data: bytes, now_ns: int) -> list[bytes]:
        now = self._instant(now_ns)
        for frame in self._scanner.feed(data):
            self._record(now, frame.data)
            if frame.definition is not None and frame.definition.name in WANTED:
                self.pipeline.on_message(decode(frame, "autopilot"), now)
        return self._flushed(now)

    def on_frame(self, frame: Mapping[str, Any], now_ns: int) -> list[bytes]:
        now = self._instant(now_ns)
        stepped_s = sum(size_s for at_ns, size_s in self._wall_steps if at_ns <= now)
        self.wall_clock.observe(now, now + self.unix_offset_ns + round(stepped_s * 1e9))
        parsed = parse_frame(json.dumps(frame), now, self.wall_clock)
        if isinstance(parsed, Frame):
            self.detections += encode_frame(parsed, self.unix_offset_ns)
        else:
            self.detections += refused_line(self._unix_us(now), {parsed.reason: 1})
        self.pipeline.on_frame(parsed, now)
        return self._flushed(now)

    def finish(self) -> None:
        now = self._instant(self._now + 1000)
        self.pipeline.finish(now)
        self._flushed(now)
        self.detections += end_line(self._unix_us(now))

    def texts(self, *codes: NoticeCode) -> list[str]:
        """Texts of the notices with one of these codes."""
        return [text for text, code in zip(self.notices, self.codes, strict=True) if code in codes]

    def texts_to_ground(self, code: NoticeCode) -> list[str]:
        """Texts of the STATUSTEXT with this code, their chunks joined."""
        texts: list[str] = []
        for _, each in self.sent:
            if each.notice is code:
                texts[len(texts) :] = [
                    texts.pop() + each.fields["text"] if each.fields["chunk_seq"] else each.fields["text"]
                ]
        return texts

    def __getstate__(self) -> dict[str, Any]:
        """Everything except the scanner, which holds compiled structs: bytes that it has not yet scanned are lost."""
        return {name: value for name, value in vars(self).items() if name != "_scanner"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _scanner=Scanner())

    def targets(self, label: str | None = None) -> list[TargetLine]:
        """All target lines, of one label or of all."""
        return [each for each in self.lines if isinstance(each, TargetLine) and label in (None, each.label)]

    def targets_file(self) -> bytes:
        return b"".join(map(encode_line, self.lines))

    def _instant(self, now_ns: int) -> HostNs:
        """A host instant in whole microseconds, different for each event, as in the service."""
        self._now = HostNs(max(whole_microseconds(now_ns), self._now + 1000))
        return self._now

    def _record(self, now: HostNs, frame: bytes) -> None:
        self.tlog += tlog_record(self._unix_us(now), frame)

    def _unix_us(self, now: HostNs) -> int:
        return (now + self.unix_offset_ns) // 1000

    def _flushed(self, now: HostNs) -> list[bytes]:
        outputs = self.pipeline.take()
        self.lines += outputs.lines
        self.notices += [notice.text for notice in outputs.notices]
        self.codes += [notice.code for notice in outputs.notices]
        frames = []
        for outgoing in outputs.messages:
            self.sent.append((now, outgoing))
            key = (outgoing.system, outgoing.component)
            encoder = self._encoders.setdefault(key, Encoder(1, outgoing.component))
            encoder.system = outgoing.system or self.pipeline.identity.system
            frames.append(encoder.encode(outgoing.name, outgoing.fields))
            self._record(now, frames[-1])
        return frames


UNKEPT = ("vehicle", "_waiting", "_order")
"""Parts of the mock that only fly it: a kept flight lacks them."""


@dataclass
class Flight:
    """The outputs and the truth of a flight."""

    companion: Companion
    mock: Simulation
    options: Options
    accepted_landings: list[dict[str, Any]]
    """What the mock autopilot made of each LANDING_TARGET that it accepted."""
    refused_landings: dict[str, int]
    """LANDING_TARGETs that the mock autopilot refused, by reason."""

    def __getstate__(self) -> dict[str, Any]:
        mock = {name: value for name, value in vars(self.mock).items() if name not in UNKEPT}
        return {**vars(self), "mock": mock}

    def __setstate__(self, state: dict[str, Any]) -> None:
        mock = object.__new__(Simulation)
        vars(mock).update(state["mock"])
        vars(self).update(state, mock=mock)

    def final(self, label: str = "target") -> TargetLine:
        """The last line of the confirmed track of this label that was seen most."""
        lines = [each for each in self.companion.targets(label) if each.is_confirmed]
        assert lines, f"no confirmed track of {label!r}"
        return lines[-1]

    def error_m(self, line: TargetLine, index: int = 0) -> float:
        """Horizontal distance of a target line to where the target was when the frame was captured."""
        true = self.mock.scene[index].at(self.seen_at_s(line))
        return hypot(line.north - true[0], line.east - true[1])

    def seen_at_s(self, line: TargetLine) -> float:
        """Time of flight of a line, seconds."""
        return self.mock.flight_s(round(line.time_unix * 1e9) - self.companion.unix_offset_ns)

    def relative_error(self, line: TargetLine) -> tuple[float, float]:
        """Error of a line's place relative to the vehicle, of the nearest target, metres, and its normalised square."""
        at_s, relative = self.seen_at_s(line), line.relative
        place = np.array((relative.north, relative.east)) + np.array(self.mock.flight.at(at_s).position)[:2]
        error = min((place - target.at(at_s)[:2] for target in self.mock.scene), key=lambda off: float(np.hypot(*off)))
        return float(np.hypot(*error)), float(error @ np.linalg.solve(np.array(relative.cov)[:2, :2], error))


def fly(options: Options, settings: Sequence[str] = (), **how: Any) -> Flight:
    """The flight of these options, settings and ``how`` of :class:`Companion`.

    It is flown once in a run of the tests; every caller gets a copy of its own.
    """
    key = repr(("fly", options, tuple(settings), sorted(how.items())))
    return kept(key, lambda: _flown(options, settings, **how))


def _flown(options: Options, settings: Sequence[str], **how: Any) -> Flight:
    """The whole flight, as fast as possible."""
    mock = simulate(options)
    steps = [(mock.start_host_ns + round(at_s * 1e9), size_s) for at_s, size_s in options.camera.wall_steps]
    companion = Companion(settings, unix_minus_host_s=mock.unix_minus_host_s, wall_steps=steps, **how)
    for _ in mock.drive(companion):
        pass
    companion.finish()
    precland = mock.vehicle.precland
    return Flight(companion, mock, options, precland.accepted, precland.refused)
