"""Periodic messages of the autopilot: every stream at its rate, each message at most one scheduler loop late."""

from __future__ import annotations

from random import Random

from sitl_mock.agenda import Agenda
from sitl_mock.options import Options
from sitl_mock.radio import Radio
from sitl_mock.streams import Streams
from sitl_mock.telemetry import Telemetry


class Broadcast:
    """Schedules the streams on the agenda and sends single messages on request."""

    def __init__(self, options: Options, telemetry: Telemetry, agenda: Agenda, radio: Radio) -> None:
        self.streams = Streams(options.autopilot)
        self._telemetry, self._agenda, self._radio = telemetry, agenda, radio
        self._loop_s = 1.0 / options.autopilot.loop_rate_hz
        self._rng = Random(f"{options.seed}/scheduler")

    def knows(self, name: str) -> bool:
        """Whether this autopilot can send this message."""
        return self._telemetry.knows(name)

    def send(self, name: str, at_ns: int) -> bool:
        """Sends one message with its present content; False where it has no content yet."""
        fields = self._telemetry.fields(name, at_ns)
        if fields is None:
            return False
        self._radio.say(name, fields, at_ns)
        return True

    def set_rate(self, name: str, rate_hz: float, now_ns: int) -> None:
        """Replaces the rate of a stream; the schedule of the former rate ends."""
        if not self.knows(name):
            return
        generation = self.streams.set_rate(name, rate_hz)
        interval_ns = self.streams.interval_ns(name)
        if interval_ns:
            self._schedule(name, now_ns + interval_ns, generation)

    def start(self, at_ns: int) -> None:
        """Starts every stream at its default rate, each with its own phase."""
        self.streams.boot()
        for name, rate_hz in self.streams.defaults_hz.items():
            if not self.knows(name):
                continue
            generation = self.streams.set_rate(name, rate_hz)
            interval_ns = self.streams.interval_ns(name)
            if interval_ns:
                self._schedule(name, at_ns + round(self._rng.random() * interval_ns), generation)

    def stop(self) -> None:
        """Stops every stream."""
        for name in list(self.streams.rates_hz):
            self.streams.set_rate(name, 0.0)

    def _schedule(self, name: str, due_ns: int, generation: int) -> None:
        """Schedules a message at a random delay within one scheduler loop; the next one counts from the due instant."""

        def send(at_ns: int) -> None:
            if self.streams.generation.get(name) != generation:
                return
            self.send(name, at_ns)
            self._schedule(name, due_ns + self.streams.interval_ns(name), generation)

        self._agenda.at(due_ns + round(self._rng.uniform(0.0, self._loop_s) * 1e9), send)
