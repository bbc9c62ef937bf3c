"""Flights on which an operator selects a target by a click, and the service acts on it: in simulated time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import atan2, hypot
from typing import Any

from configured_links import AUTOPILOT, GROUND
from flying import CAMERA, Companion
from kept import kept

from fwav_companion.mavlink.wire.codec import Encoder, decode
from fwav_companion.mavlink.wire.scanner import Scanner
from fwav_companion.types import NoticeCode, Outgoing
from sitl_mock import Options, Simulation, TargetOptions, scenario, simulate
from sitl_mock.scenarios import NO_NOISE, NO_TROUBLE

STATION = (255, 190)
TRACK_POINT, TRACK_RECTANGLE, STOP = 2004, 2005, 2010
ORBIT = {
    "flight.pattern": "orbit",
    "flight.height_m": 15.0,
    "gimbal.device_id": 1,
    "gimbal.yaw": "vehicle",
    "gimbal.manager": True,
    "autopilot.rates_hz": {"GIMBAL_DEVICE_ATTITUDE_STATUS": 10.0},
    "targets": (TargetOptions(label="person"),),
    "camera.clutter": 0.0,
}
QUIET = {**NO_NOISE, **NO_TROUBLE}
"""Without noise and biases: what is tested is what is sent."""


@dataclass
class Operator:
    """A ground station: its heartbeats, and the commands that it sends at an instant of the flight."""

    commands: Sequence[tuple[float, int]] = ((5.0, TRACK_RECTANGLE),)
    """(seconds, command) to the camera; a selection takes the whole picture, or its middle by a point."""
    silent_from_s: float = 1e9
    link: str = "ground"
    ids: tuple[int, int] = STATION
    to_component: int = 100
    signed: bool = False


class Operated(Companion):
    """The service with a ground station on its second link."""

    def __init__(self, operator: Operator, start_ns: int, settings: Sequence[str], unix_minus_host_s: float) -> None:
        text = AUTOPILOT + GROUND + '[camera]\ncalibration = "camera.yaml"\n'
        super().__init__(settings, unix_minus_host_s=unix_minus_host_s, text=text)
        self.operator, self._start_ns = operator, start_ns
        self._station = Encoder(*operator.ids)
        self._reader = Scanner()
        self._todo = sorted(
            [(float(second), "HEARTBEAT", 0) for second in range(int(min(operator.silent_from_s, 600.0)))]
            + [(at_s, "COMMAND_LONG", number) for at_s, number in operator.commands]
        )

    @property
    def wake_at(self) -> int | None:
        own = super().wake_at
        if not self._todo:
            return own
        due = self._start_ns + round(self._todo[0][0] * 1e9)
        return due if own is None else min(own, due)

    def on_wake(self, now_ns: int) -> list[bytes]:
        now = self._instant(now_ns)
        while self._todo and self._start_ns + round(self._todo[0][0] * 1e9) <= now:
            _, name, number = self._todo.pop(0)
            self.tell(name, self._fields(name, number), now)
        return [*super().on_wake(now)]

    def tell(self, name: str, fields: Mapping[str, Any], now: int) -> None:
        """Give the service a message of the station."""
        for frame in self._reader.feed(self._station.encode(name, fields)):
            message = decode(frame, self.operator.link)
            self.pipeline.on_message(message, self._instant(now))

    def _fields(self, name: str, number: int) -> dict[str, Any]:
        if name == "HEARTBEAT":
            return {
                "type": 6, "autopilot": 8, "base_mode": 0, "custom_mode": 0, "system_status": 4, "mavlink_version": 3,
            }  # fmt: skip
        params = {TRACK_RECTANGLE: (0.0, 0.0, 1.0, 1.0), TRACK_POINT: (0.5, 0.5, 0.5, 0.0)}.get(number, (0.0,) * 4)
        return {
            "target_system": 1,
            "target_component": self.operator.to_component,
            "command": number,
            "confirmation": 0,
            **{f"param{index}": (*params, 0.0, 0.0, 0.0)[index - 1] for index in range(1, 8)},
        }

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in super().__getstate__().items() if name != "_reader"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__(state)
        self._reader = Scanner()


@dataclass
class ActingFlight:
    """What was sent in a flight, and where the target was in the picture."""

    options: Options
    companion: Operated
    gimbal_commands: list[tuple[float, float, float]]
    dropped: int
    primary: tuple[int, int]
    roi: list[Any]
    followed: list[Any]
    follow_refused: dict[str, int]
    off_px: list[tuple[float, float, float]] = field(default_factory=list)
    """(flight time, u, v from the middle) of the target in each frame, pixels; from the truth."""
    start_ns: int = 0

    def sent(self, *names: str) -> list[Outgoing]:
        return [each for _, each in self.companion.sent if each.name in names]

    def times_s(self, name: str) -> list[float]:
        return [(now - self.start_ns) * 1e-9 for now, each in self.companion.sent if each.name == name]

    def commands(self, number: int) -> list[Outgoing]:
        return [each for each in self.sent("COMMAND_LONG", "COMMAND_INT") if each.fields["command"] == number]

    def texts(self, *codes: NoticeCode) -> list[str]:
        return self.companion.texts(*codes)

    def share_within(self, share_of_width: float, from_s: float, to_s: float) -> float:
        """Share of the frames in which the target is within this share of the image's width of the middle."""
        most = share_of_width * self.options.camera.image_size[0]
        seen = [hypot(u, v) <= most for t, u, v in self.off_px if from_s <= t < to_s]
        return sum(seen) / len(seen)


def fly_acting(
    act: Sequence[str],
    operator: Operator | None = None,
    *,
    settings: Sequence[str] = (),
    seed: int = 1,
    seconds: float = 20.0,
    **differences: Any,
) -> ActingFlight:
    """A flight with these keys of [act], flown once in a run of the tests."""
    options = scenario("gimbal", Options(seed=seed)).but({**ORBIT, **QUIET, "seconds": seconds, **differences})
    who = operator or Operator()
    mount = []
    if options.gimbal.device_id:
        mount = [f"camera.mount.gimbal_device_id={options.gimbal.device_id}", "camera.mount.pitch_deg=0.0"]
    keys = [*mount, "camera.readout_s=0.0", *(f"act.{each}" for each in act), *settings]
    return kept(repr(("act", options, who, keys)), lambda: _flown(options, who, keys))


def _flown(options: Options, operator: Operator, settings: Sequence[str]) -> ActingFlight:
    mock: Simulation = simulate(options)
    companion = Operated(operator, mock.start_host_ns, settings, mock.unix_minus_host_s)
    off = []
    for _, what in mock.drive(companion):
        if isinstance(what, dict):
            off.append(_off_px(mock, what))
    companion.finish()
    vehicle = mock.vehicle
    return ActingFlight(
        options,
        companion,
        vehicle.gimbal_manager.commands,
        vehicle.gimbal_manager.dropped,
        vehicle.gimbal_manager.primary,
        vehicle.gimbal_manager.roi,
        vehicle.follow.heard,
        vehicle.follow.refused,
        [each for each in off if each is not None],
        mock.start_host_ns,
    )


def _off_px(mock: Simulation, frame: dict[str, Any]) -> tuple[float, float, float]:
    """The first target's pixel from the principal point, from the truth at the frame's capture; far where unseen."""
    t = mock.camera.row0_s(frame["frame"])
    u, v = mock.camera._project(mock.scene[0].at(t), t)
    middle_u, middle_v = mock.options.camera.principal_point
    return (t, u - middle_u, v - middle_v) if u == u else (t, 1e9, 1e9)


__all__ = ["CAMERA", "ActingFlight", "Operated", "Operator", "atan2", "fly_acting"]
