"""A gimbal that is its own MAVLink component, with its own clock, behind the autopilot's link."""

from __future__ import annotations

from collections.abc import Callable

from sitl_mock.agenda import Agenda
from sitl_mock.clock import BootClock
from sitl_mock.codec import Speaker
from sitl_mock.gimbal import MESSAGE, Gimbal
from sitl_mock.options import Options
from sitl_mock.radio import Radio

LEVEL = [1.0, 0.0, 0.0, 0.0]
"""Where a second gimbal looks: ahead."""


class GimbalComponent:
    """MAVLink component of the gimbal, with its own ids and sequence."""

    def __init__(
        self,
        options: Options,
        gimbal: Gimbal,
        flight_s: Callable[[int], float],
        agenda: Agenda,
        radio: Radio,
        start_host_ns: int,
    ) -> None:
        self._o, self._gimbal, self._flight_s = options.gimbal, gimbal, flight_s
        self._agenda, self._radio = agenda, radio
        self._speaker = Speaker(options.autopilot.system_id, self._o.device_id)
        self._clock = BootClock(start_host_ns, round(self._o.boot_at_start_s * 1e9), self._o.drift_ppm)
        agenda.at(start_host_ns + 70_000_000, self._say)
        self._elsewhere = Speaker(options.autopilot.system_id, self._o.second_id)
        if self._o.resets_at_s:
            agenda.at(start_host_ns + round(self._o.resets_at_s * 1e9), self._clock.reboot)

    def _say(self, at_ns: int) -> None:
        flight_s = self._flight_s(at_ns)
        fields = self._gimbal.fields(flight_s, self._clock.boot_ns(at_ns) // 1_000_000)
        if not self._o.silent_from_s or flight_s < self._o.silent_from_s:
            self._radio.put(self._speaker.frame(MESSAGE, fields), at_ns)
            if self._o.second_id:
                self._radio.put(self._elsewhere.frame(MESSAGE, {**fields, "q": LEVEL}), at_ns)
        self._agenda.at(at_ns + round(1e9 / self._o.rate_hz), self._say)
