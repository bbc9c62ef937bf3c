"""Finds which station may have changed our message rates: one whose request was seen, or else one that is present."""

from __future__ import annotations

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.wire import enums
from fwav_companion.types.messages import Message
from fwav_companion.types.situation import Autopilot

BLAME_NS = 15 * NS_PER_S
"""Time after a station's rate request for which a fallen rate is attributed to it."""
PRESENT_NS = 15 * NS_PER_S
"""Time after a ground station's last heartbeat for which it counts as present."""
MOST_STATIONS = 8
COMMANDS = frozenset({"COMMAND_LONG", "COMMAND_INT"})
NO_STATION = "no station seen"


class RateCompetitors:
    """Remembers the requests that were seen, and the ground stations that share our link to the autopilot.

    Behind a router, or on the same radio, a ground station's requests do not pass through us; its heartbeat shows that
    it is present.
    """

    __slots__ = ("_seen", "_stations")

    def __init__(self) -> None:
        self._seen: tuple[str, HostNs] | None = None
        self._stations: dict[tuple[int, int], HostNs] = {}

    def saw(self, sender: str, now: HostNs) -> bool:
        """Note a station's rate request to the autopilot. Returns True unless the last one was from the same station,
        lately.
        """
        before, self._seen = self._seen, (sender, now)
        return before is None or before[0] != sender or now - before[1] > BLAME_NS

    def on_message(self, message: Message, autopilot: Autopilot, now: HostNs) -> None:
        """Take a message of another component on the autopilot's link."""
        sender = (message.system, message.component)
        if message.link != autopilot.link or sender == (autopilot.system, autopilot.component):
            return
        if message.name == "HEARTBEAT" and message.fields.type == enums.MAV_TYPE_GCS:
            if sender in self._stations or len(self._stations) < MOST_STATIONS:
                self._stations[sender] = now
        elif message.name in COMMANDS and message.fields.command == enums.MAV_CMD_SET_MESSAGE_INTERVAL:
            self.saw(f"{sender[0]}/{sender[1]} on {message.link}", now)

    def to_blame(self, autopilot: Autopilot | None, now: HostNs) -> str:
        """Return the station whose request was seen, or else the stations that are present and presumed."""
        if self._seen is not None and now - self._seen[1] <= BLAME_NS:
            return self._seen[0]
        present = [sender for sender, heard_ns in self._stations.items() if now - heard_ns <= PRESENT_NS]
        if not present or autopilot is None:
            return NO_STATION
        names = ", ".join(f"{system}/{component}" for system, component in sorted(present))
        return f"presumably the ground station {names} on {autopilot.link}"
