"""An autopilot's follow mode, as far as it reads FOLLOW_TARGET. The vehicle's own path stays the scenario's."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, nan

from sitl_mock.belief import Belief
from sitl_mock.codec import Heard
from sitl_mock.earth import Place
from sitl_mock.options import Options

FOLLOW_TIMEOUT_S = 3.0
POSITION = 1


class FollowMode:
    """ArduPilot's AP_Follow or PX4's follow target, as far as they read FOLLOW_TARGET."""

    def __init__(self, options: Options, belief: Belief, flight_s: Callable[[int], float]) -> None:
        self._a, self._belief, self._flight_s = options.autopilot, belief, flight_s
        self.refused: dict[str, int] = {}
        self.heard: list[tuple[float, tuple[float, float, float], tuple[float, float, float]]] = []
        """(flight time, position in NED, velocity) of each target that was taken; nan where it has no velocity."""

    def hear(self, heard: Heard, now_ns: int) -> None:
        """Takes FOLLOW_TARGET."""
        f, t = heard.fields, self._flight_s(now_ns)
        if self._a.firmware != "px4" and heard.system == self._a.system_id:
            self._refuse("the vehicle's own system")
        elif self._a.follow_system_id and heard.system != self._a.follow_system_id:
            self._refuse("another system than FOLL_SYSID")
        elif not f["est_capabilities"] & POSITION:
            self._refuse("no position")
        else:
            place = self._belief.world.ned(Place(f["lat"] * 1e-7, f["lon"] * 1e-7, f["alt"]))
            north, east, down = f["vel"] if f["est_capabilities"] & 2 else (nan, nan, nan)
            velocity = (north, east, down)
            self.heard.append((t, place, velocity))

    def target_at(self, t: float) -> tuple[float, float, float] | None:
        """Where the mode holds its target to be; None once it is too old."""
        known = [each for each in self.heard if each[0] <= t]
        if not known or t - known[-1][0] > FOLLOW_TIMEOUT_S:
            return None
        at_s, place, velocity = known[-1]
        north, east, down = (p + (v * (t - at_s) if isfinite(v) else 0.0) for p, v in zip(place, velocity, strict=True))
        return north, east, down

    def _refuse(self, why: str) -> None:
        self.refused[why] = self.refused.get(why, 0) + 1
