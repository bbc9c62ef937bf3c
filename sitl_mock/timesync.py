"""TIMESYNC as in autopilots: answers requests, sends its own, and accepts the answer that returns its own ts1."""

from __future__ import annotations

from random import Random
from typing import Any

from sitl_mock.agenda import Agenda
from sitl_mock.clock import BootClock
from sitl_mock.codec import Heard
from sitl_mock.options import Options
from sitl_mock.radio import Radio

ARDUPILOT_ASKS_EVERY_NS = 10_000_000_000
PX4_ASKS_EVERY_NS = 100_000_000
LATE_S = (0.005, 0.05)
KEPT = 50
"""Most exchanges of its own requests that are kept, newest last."""


class Timesync:
    """TIMESYNC component: the requester's ts1 is returned unchanged; tc1 is the responder's, 0 in a request.
    Nanoseconds.
    """

    def __init__(self, options: Options, clock: BootClock, agenda: Agenda, radio: Radio, start_host_ns: int) -> None:
        self._o, self._clock = options.autopilot, clock
        self._agenda, self._radio = agenda, radio
        self._rng = Random(f"{options.seed}/timesync")
        self._asked = self._answered = 0
        self._off, self._start_ns = len(self._o.first_timesync_off_s), start_host_ns
        self.exchanges: list[tuple[int, int]] = []
        """(round trip, peer's clock minus boot clock at the middle) of its own requests, ns."""
        if self._o.sends_timesync:
            agenda.at(start_host_ns + 300_000_000, self._ask)

    def hear(self, heard: Heard, now_ns: int) -> None:
        """Answers a request; records the exchange of an answer to the last request."""
        if heard.fields["tc1"] != 0:
            self._learn(heard.fields, now_ns)
        elif self._answers(now_ns):
            late_ns = round(self._rng.uniform(0.0, self._o.poll_delay_s) * 1e9)
            if self._o.timesync_late_share and self._rng.random() < self._o.timesync_late_share:
                late_ns += round(self._rng.uniform(*LATE_S) * 1e9)
            off_s = self._o.first_timesync_off_s[self._answered] if self._answered < self._off else 0.0
            self._answered += 1
            answer = {"tc1": max(1, self._boot_ns(now_ns) + round(off_s * 1e9)), "ts1": heard.fields["ts1"]}
            self._agenda.at(now_ns + late_ns, lambda at: self._radio.say("TIMESYNC", answer, at))

    def _answers(self, now_ns: int) -> bool:
        until_s = self._o.answers_timesync_until_s
        return self._o.answers_timesync and (until_s is None or now_ns - self._start_ns < until_s * 1e9)

    def peer_ns(self, host_ns: int) -> int | None:
        """Peer's clock at a host instant, by the exchange with the shortest round trip; None before the first."""
        return self._clock.boot_ns(host_ns) + min(self.exchanges)[1] if self.exchanges else None

    def _boot_ns(self, host_ns: int) -> int:
        """Boot time in whole microseconds, as ArduPilot's clock."""
        return max(1, self._clock.boot_ns(host_ns) // 1000 * 1000)

    def _ask(self, at_ns: int) -> None:
        px4 = self._o.firmware == "px4"
        self._asked = self._boot_ns(at_ns) + (0 if px4 else self._o.system_id)
        self._radio.say("TIMESYNC", {"tc1": 0, "ts1": self._asked}, at_ns)
        self._agenda.at(at_ns + (PX4_ASKS_EVERY_NS if px4 else ARDUPILOT_ASKS_EVERY_NS), self._ask)

    def _learn(self, fields: dict[str, Any], now_ns: int) -> None:
        if fields["ts1"] != self._asked:
            return
        now = self._boot_ns(now_ns)
        self.exchanges.append((now - self._asked, fields["tc1"] - (self._asked + now) // 2))
        del self.exchanges[:-KEPT]
