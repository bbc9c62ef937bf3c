"""The parts of a vehicle and how long each has been silent: no state is better than its newest evidence. Pure."""

from __future__ import annotations

from collections.abc import Mapping

from fwav_companion.ground.views import VehicleView

SILENT_S = 5.0
"""Time without a message after which a part is silent and a value is old, seconds: five missed heartbeats (MAVLink,
Heartbeat/Connection Protocol)."""
PARTS = ("autopilot", "companion", "camera", "detector")
"""The parts in the order in which they are named."""
CARRIED_BY = {"camera": "companion", "detector": "camera"}
"""The part through which a part is heard: where that one is silent, nothing is known of the other."""
STATED_BY = ("autopilot", "companion")
"""The parts without which a report of readiness means nothing."""
WHOLE = "vehicle"
"""Key of the silence of every part."""
NOTHING_SAID: set[str] = set()
HELD_S = 2.0
"""Two heartbeats: the time within which the parts of one vehicle fall silent together."""
REMEDIES = {
    "autopilot": "check its power and its wire to the companion",
    "companion": "check its power and that the service runs",
    "camera": "check its cable and [vision] source",
    "detector": "check that it runs and sends to [detections] url",
}
"""What to do about a silent part."""


def newest(heard: Mapping[str, float], otherwise: float) -> float:
    """The newest instant of any part; without a part that of any value."""
    parts = [heard[part] for part in PARTS if part in heard]
    return max(parts or heard.values(), default=otherwise)


def silent_parts(heard: Mapping[str, float], now: float) -> dict[str, float]:
    """The parts that were heard and are silent now, with the instant of their last message."""
    silent = {part: heard[part] for part in PARTS if part in heard and now > heard[part] + SILENT_S}
    return {part: since for part, since in silent.items() if not _is_behind(part, silent)}


def _is_behind(part: str, silent: Mapping[str, float]) -> bool:
    """Whether a part through which this one is heard is silent."""
    carrier = CARRIED_BY.get(part)
    return carrier is not None and (carrier in silent or _is_behind(carrier, silent))


class SilenceTexts:
    """Decides which silences and returns are reported as texts: each once.

    A part of a vehicle that is heard otherwise is reported a little later than it is shown: where the whole vehicle
    falls silent, its parts do so within this time, and one text says it.
    """

    def __init__(self) -> None:
        self._said: dict[str, set[str]] = {}
        self._by_vehicle: dict[str, set[str]] = {}
        """Parts whose silence and return the vehicle's own texts report."""
        self._back_unix: dict[str, float] = {}
        """Instant at which a vehicle that was silent as a whole was heard again: its parts return one by one."""

    def on_reported(self, vehicle: str, part: str) -> None:
        """Leave a part's silence to the vehicle's own texts, which have reported it and will report its return."""
        self._by_vehicle.setdefault(vehicle, set()).add(part)

    def forget(self, vehicle: str) -> None:
        """Forget what was said of a vehicle that is no longer shown."""
        for kept in (self._said, self._by_vehicle, self._back_unix):
            kept.pop(vehicle, None)

    def due(self, vehicle: VehicleView, now: float) -> list[tuple[str, bool]]:
        """(text, whether it is a warning) of each change that is to be reported now."""
        said = self._said.get(vehicle.id, NOTHING_SAID)
        if not said and not vehicle.quiet and not vehicle.silent:
            return []
        said = self._said.setdefault(vehicle.id, set())
        by_vehicle = self._by_vehicle.setdefault(vehicle.id, set())
        texts = []
        if vehicle.silent and WHOLE not in said:
            said.add(WHOLE)
            texts.append((f"silent for {now - vehicle.heard_unix:.0f} s: check its link", True))
        elif not vehicle.silent and WHOLE in said:
            said.discard(WHOLE)
            self._back_unix[vehicle.id] = now
            texts.append(("is heard again", False))
        back_unix = self._back_unix.get(vehicle.id, 0.0)
        for part, since in vehicle.quiet.items():
            if part not in said and not vehicle.silent and now > max(since, back_unix) + SILENT_S + HELD_S:
                said.add(part)
                if part not in by_vehicle:
                    texts.append((f"{part} silent for {now - since:.0f} s: {REMEDIES[part]}", True))
        for part in [part for part in PARTS if part in said and part not in vehicle.quiet and not vehicle.silent]:
            said.discard(part)
            if part not in by_vehicle:
                texts.append((f"{part} is heard again", False))
            by_vehicle.discard(part)
        return texts
