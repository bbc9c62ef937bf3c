"""Other participants on the network: a foreign TIMESYNC component, a second vehicle, a ground station that changes
rates.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sin

from sitl_mock.agenda import Agenda
from sitl_mock.broadcast import Broadcast
from sitl_mock.codec import Heard, Speaker
from sitl_mock.options import Options
from sitl_mock.radio import Radio
from sitl_mock.streams import GROUPS

FOREIGN_CLOCK_NS = 98_765_432_109_876
"""Clock of the foreign component minus the host's, ns: more than a day."""
STOLEN_HZ = 4.0
SECOND_NS = 1_000_000_000
ONBOARD, GROUND_STATION, PLANE, NO_AUTOPILOT = 18, 6, 1, 8


class Others:
    """Other participants; each sends through the vehicle's link, with its own ids and sequence."""

    def __init__(
        self,
        options: Options,
        broadcast: Broadcast,
        flight_s: Callable[[int], float],
        agenda: Agenda,
        radio: Radio,
        start_host_ns: int,
    ) -> None:
        self._o, self._broadcast, self._flight_s = options.others, broadcast, flight_s
        self._agenda, self._radio = agenda, radio
        self._foreigner = Speaker(options.autopilot.system_id, 195)
        self._second = Speaker(options.autopilot.system_id + 1, 1)
        self._ground = Speaker(255, 190)
        if self._o.foreign_timesync:
            agenda.at(start_host_ns + 450_000_000, self._ask_foreign)
        if self._o.second_vehicle:
            agenda.at(start_host_ns + 120_000_000, self._second_heartbeat)
            agenda.at(start_host_ns + 130_000_000, self._second_attitude)
        if self._o.ground_station:
            agenda.at(start_host_ns + 50_000_000, self._ground_heartbeat)
        if self._o.rates_stolen_every_s:
            agenda.at(start_host_ns + round(self._o.rates_stolen_every_s * 1e9), self._steal)

    def hear_timesync(self, heard: Heard, now_ns: int) -> None:
        """Answers, as the foreign component, a TIMESYNC request that was not meant for it."""
        if self._o.foreign_timesync and heard.fields["tc1"] == 0:
            answer = {"tc1": now_ns + FOREIGN_CLOCK_NS, "ts1": heard.fields["ts1"]}
            self._say(self._foreigner, "TIMESYNC", answer, now_ns)

    def _say(self, speaker: Speaker, name: str, fields: dict[str, object], at_ns: int) -> None:
        self._radio.put(speaker.frame(name, fields), at_ns)

    def _ask_foreign(self, at_ns: int) -> None:
        request: dict[str, object] = {"tc1": 0, "ts1": at_ns + FOREIGN_CLOCK_NS}
        self._say(self._foreigner, "TIMESYNC", request, at_ns)
        if at_ns // SECOND_NS != (at_ns - SECOND_NS // 10) // SECOND_NS:
            self._say(self._foreigner, "HEARTBEAT", _heartbeat(ONBOARD, NO_AUTOPILOT), at_ns)
        self._agenda.at(at_ns + SECOND_NS // 10, self._ask_foreign)

    def _second_heartbeat(self, at_ns: int) -> None:
        self._say(self._second, "HEARTBEAT", _heartbeat(PLANE, 3), at_ns)
        self._agenda.at(at_ns + SECOND_NS, self._second_heartbeat)

    def _second_attitude(self, at_ns: int) -> None:
        t = self._flight_s(at_ns)
        fields: dict[str, object] = {
            "time_boot_ms": (at_ns // 1_000_000 + 5_000_000) % 2**32,
            "roll": 0.5 * sin(t),
            "pitch": -0.3,
            "yaw": 1.0,
            "rollspeed": 0.0,
            "pitchspeed": 0.0,
            "yawspeed": 0.0,
        }
        self._say(self._second, "ATTITUDE", fields, at_ns)
        self._agenda.at(at_ns + SECOND_NS // 10, self._second_attitude)

    def _ground_heartbeat(self, at_ns: int) -> None:
        self._say(self._ground, "HEARTBEAT", _heartbeat(GROUND_STATION, NO_AUTOPILOT), at_ns)
        self._agenda.at(at_ns + SECOND_NS, self._ground_heartbeat)

    def _steal(self, at_ns: int) -> None:
        """Applies a REQUEST_DATA_STREAM of 4 Hz; messages outside the groups keep their rates, ATTITUDE_QUATERNION
        stops.
        """
        for names in GROUPS.values():
            for name in names:
                self._broadcast.set_rate(name, STOLEN_HZ, at_ns)
        self._broadcast.set_rate("ATTITUDE_QUATERNION", 0.0, at_ns)
        self._agenda.at(at_ns + round(self._o.rates_stolen_every_s * 1e9), self._steal)


def _heartbeat(kind: int, autopilot: int) -> dict[str, object]:
    return {
        "type": kind,
        "autopilot": autopilot,
        "base_mode": 0,
        "custom_mode": 0,
        "system_status": 4,
        "mavlink_version": 3,
    }
