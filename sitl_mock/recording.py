"""A simulated flight written as a recording: telemetry.tlog, detections.jsonl, truth.jsonl, truth.csv."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any, BinaryIO

from sitl_mock import truth
from sitl_mock.codec import NUMBERS, Speaker
from sitl_mock.options import Options
from sitl_mock.outputs import DetectionFile, DetectionLines, TruthFile
from sitl_mock.simulate import Event, Simulation

DEFAULT_RATES_HZ = {
    "ATTITUDE_QUATERNION": 100.0,
    "GLOBAL_POSITION_INT": 10.0,
    "HOME_POSITION": 0.2,
    "GPS_GLOBAL_ORIGIN": 0.2,
}
SET_INTERVAL, SECOND_NS, TENTH_NS = 511, 1_000_000_000, 100_000_000


class MinimalPeer:
    """Minimal companion: TIMESYNC ten times a second, a heartbeat each second, rate requests every five seconds."""

    def __init__(self, start_host_ns: int, rates_hz: dict[str, float] | None = None) -> None:
        self._speaker = Speaker(1, 191)
        self._rates_hz = DEFAULT_RATES_HZ if rates_hz is None else rates_hz
        self._beat = 0
        self._start = start_host_ns + 50_000_000

    @property
    def wake_at(self) -> int | None:
        """Instant of the next timer, ten times a second."""
        return self._start + self._beat * TENTH_NS

    def on_wake(self, now_ns: int) -> list[bytes]:
        """Sends TIMESYNC; each second the heartbeat, every five seconds the rate requests."""
        frames = [self._speaker.frame("TIMESYNC", {"tc1": 0, "ts1": now_ns + self._beat % 1000})]
        if self._beat % 10 == 0:
            fields = {"type": 18, "autopilot": 8, "base_mode": 0, "custom_mode": 0, "system_status": 4}
            frames.append(self._speaker.frame("HEARTBEAT", {**fields, "mavlink_version": 3}))
        if self._beat % 50 == 0:
            frames.extend(self._request(name, hz) for name, hz in self._rates_hz.items())
        self._beat += 1
        return frames

    def on_bytes(self, _data: bytes, _now_ns: int) -> list[bytes]:
        """Ignores the received bytes."""
        return []

    def on_frame(self, _frame: dict[str, Any], _now_ns: int) -> list[bytes]:
        """Ignores the detections."""
        return []

    def _request(self, name: str, rate_hz: float) -> bytes:
        zeros = {f"param{i}": 0.0 for i in range(3, 8)}
        fields = {"target_system": 1, "target_component": 1, "command": SET_INTERVAL, "confirmation": 0, **zeros}
        return self._speaker.frame("COMMAND_LONG", {**fields, "param1": NUMBERS[name], "param2": 1e6 / rate_hz})


class Recorded(Simulation):
    """Simulation that writes both directions of its link to a .tlog.

    Whole frames and wall-clock stamps, whatever the options are: recordings hold these.
    """

    def __init__(self, options: Options, tlog: BinaryIO) -> None:
        super().__init__(options.but({"downlink.byte_by_byte": False, "camera.stamp_clock": "time_unix"}))
        self._tlog = tlog

    def fly(
        self, detections: DetectionLines, on_truth: Callable[[Event], None], rates_hz: dict[str, float] | None = None
    ) -> None:
        """Flies to the end; writes telemetry and detections, and passes on the events of the truth."""
        for host_ns, what in self.drive(MinimalPeer(self.start_host_ns, rates_hz)):
            if isinstance(what, bytes):
                self.write(what, host_ns)
            elif isinstance(what, dict):
                detections.write(what, host_ns)
            else:
                on_truth((host_ns, what))

    def on_bytes(self, data: bytes, now_ns: int) -> None:
        """Writes the companion's bytes, then passes them on."""
        self.write(data, now_ns)
        super().on_bytes(data, now_ns)

    def write(self, data: bytes, host_ns: int) -> None:
        """Writes a .tlog record: Unix microseconds, big endian, then the frame."""
        unix_us = host_ns // 1000 + round(self.unix_minus_host_s * 1e6)
        self._tlog.write(unix_us.to_bytes(8, "big") + data)


def record(options: Options, folder: Path, rates_hz: dict[str, float] | None = None) -> Simulation:
    """Writes the flight into the folder, as fast as it can be computed; returns the simulation for further queries."""
    folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as opened:
        simulation = Recorded(options, opened.enter_context((folder / "telemetry.tlog").open("wb")))
        lines = DetectionFile(folder / "detections.jsonl", simulation.unix_minus_host_s)
        detections = opened.enter_context(closing(lines))
        truth_file = opened.enter_context(closing(TruthFile(folder / "truth.jsonl", simulation)))
        simulation.fly(detections, truth_file.take, rates_hz)
    (folder / "truth.csv").write_text(truth.csv_text(simulation, options.seconds), encoding="utf-8")
    return simulation
