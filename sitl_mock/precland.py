"""The autopilot's receiver of LANDING_TARGET: its consumer judges every message, and the results are kept for the
report.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

from sitl_mock.autopilot_options import AutopilotOptions
from sitl_mock.belief import Belief
from sitl_mock.codec import Heard
from sitl_mock.flight import State
from sitl_mock.lander import Lander
from sitl_mock.landing import CONSUMERS, Situation
from sitl_mock.radio import Radio
from sitl_mock.rotation import minus, norm
from sitl_mock.scene import Target

KEPT = 20_000
"""Most accepted targets kept: more than half an hour at 10 Hz."""
WARNING, INFO = 4, 6


class PrecisionLanding:
    """Results of the received messages: ``accepted``, and ``refused`` counted by reason."""

    def __init__(
        self,
        options: AutopilotOptions,
        belief: Belief,
        scene: list[Target],
        flight_s: Callable[[int], float],
        peer_ns: Callable[[int], int | None],
        radio: Radio,
        lander: Lander | None = None,
    ) -> None:
        """``peer_ns``: converts a host instant to the clock that answers the autopilot's TIMESYNC; None before the
        first answer. ``lander``: follows what is accepted.
        """
        self._o, self._belief, self._scene = options, belief, scene
        self._flight_s, self._peer_ns, self._radio, self._lander = flight_s, peer_ns, radio, lander
        self.name = options.landing_consumer or ("px4" if options.firmware == "px4" else "ardupilot_new")
        self._consume = CONSUMERS[self.name]
        self.accepted: list[dict[str, Any]] = []
        self.refused: Counter[str] = Counter()

    def hear(self, heard: Heard, now_ns: int) -> None:
        """Judges one message by the true state at the instants that this consumer uses."""
        if self.name != "px4" and not self._o.precland_enabled:
            self.refused["not_enabled"] += 1
            return
        t = self._flight_s(now_ns)
        landing = self._consume(heard.fields, self._situation(t, self._belief.truth))
        if landing.position is None:
            self._refuse(landing.reason, now_ns)
        else:
            self._accept(heard, t, landing.position, now_ns)
            if self._lander is not None:
                self._follow(heard, t, self._lander)

    def report(self, now_ns: int) -> None:
        """Sends the lander's texts."""
        if self._lander is not None:
            for text in self._lander.texts:
                self._radio.statustext(INFO, text, now_ns)
            self._lander.texts.clear()

    def _situation(self, t: float, state_at: Callable[[float], State]) -> Situation:
        """The vehicle at an instant by these states."""
        belief, lagged, now = self._belief, state_at(t - self._o.precland_lag_s), state_at(t)
        height_m = belief.range_m(t) * max(0.0, now.ned_from_body[2][2])
        return Situation(lagged, now, height_m, belief.projection, belief.world)

    def _follow(self, heard: Heard, t: float, lander: Lander) -> None:
        """Hands the vector to the lander as the autopilot rotates it: by its own attitude, not by the true one."""
        own = self._situation(t, self._belief.own_state)
        position = self._consume(heard.fields, own).position
        if position is not None:
            stamp_ms = heard.fields["time_usec"] // 1000
            vector = minus(position, own.lagged.position)
            self.accepted[-1]["followed"] = (own.lagged.flight_s, *vector)
            lander.hear(vector, stamp_ms, own.lagged.flight_s)

    def summary(self) -> dict[str, Any]:
        """Summary for the truth file."""
        errors = [one["error_m"] for one in self.accepted]
        return {
            "consumer": self.name,
            "accepted": len(self.accepted),
            "refused": dict(self.refused),
            "mean_error_m": sum(errors) / len(errors) if errors else None,
            "last": self.accepted[-1] if self.accepted else None,
        }

    def _refuse(self, reason: str, now_ns: int) -> None:
        self.refused[reason] += 1
        if reason == "frame_not_supported" and self.refused[reason] == 1:
            self._radio.statustext(WARNING, "Plnd: Frame not supported", now_ns)

    def _accept(self, heard: Heard, t: float, position: tuple[float, float, float], now_ns: int) -> None:
        if not self.accepted and self.name != "px4" and self._lander is None:
            self._radio.statustext(INFO, "PrecLand: Target Found", now_ns)
        if len(self.accepted) >= KEPT:
            return
        errors = [(norm(minus(position, target.at(t))), i) for i, target in enumerate(self._scene)]
        error_m, nearest = min(errors, default=(float("inf"), -1))
        place = self._belief.world.place(position)
        self.accepted.append(
            {
                "flight_s": t,
                "north": position[0],
                "east": position[1],
                "down": position[2],
                "lat": place.lat,
                "lon": place.lon,
                "alt_amsl": place.alt_amsl,
                "nearest_target": nearest,
                "error_m": error_m,
                "time_usec": heard.fields["time_usec"],
                "capture_age_s": self._age_s(heard.fields["time_usec"], now_ns),
                "from": [heard.system, heard.component],
            }
        )

    def _age_s(self, time_usec: int, now_ns: int) -> float | None:
        """Age of the capture, if time_usec is on the peer's clock; None before the first TIMESYNC answer."""
        peer_ns = self._peer_ns(now_ns)
        return None if peer_ns is None else (peer_ns - time_usec * 1000) * 1e-9
