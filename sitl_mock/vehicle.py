"""The mock autopilot, pure: bytes in with their instant, bytes out with theirs. Both live and invented time run it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from random import Random
from typing import Any

from sitl_mock.agenda import Agenda
from sitl_mock.belief import Belief
from sitl_mock.clock import BootClock
from sitl_mock.codec import Heard, Listener, Speaker
from sitl_mock.commands import Commands
from sitl_mock.draws import DrawnBiases
from sitl_mock.earth import World
from sitl_mock.flight import Flight
from sitl_mock.gimbal import BEHIND_AUTOPILOT, GimbalComponent
from sitl_mock.options import Options
from sitl_mock.others import Others
from sitl_mock.parameters import Parameters
from sitl_mock.precland import PrecisionLanding
from sitl_mock.scene import Target
from sitl_mock.streams import Streams
from sitl_mock.telemetry import Telemetry
from sitl_mock.timesync import Timesync
from sitl_mock.wire import Wire

Handler = Callable[[Heard, int], None]


class MockVehicle:
    """``on_bytes(data, now)``, ``wake_at``, ``advance(now) -> [(deliver_at, bytes)]``; instants in host nanoseconds."""

    def __init__(
        self,
        options: Options,
        biases: DrawnBiases,
        flight: Flight,
        world: World,
        scene: list[Target],
        clock: BootClock,
        start_host_ns: int,
        unix_minus_host_s: float = 0.0,
    ) -> None:
        self.options, self.world, self.clock = options, world, clock
        self.agenda = Agenda()
        self.belief = Belief(options, biases, flight, world)
        self.telemetry = Telemetry(options, self.belief, clock, start_host_ns)
        self.telemetry.utc_minus_host_s = unix_minus_host_s + options.autopilot.utc_minus_host_wall_s
        self.streams = Streams(options.autopilot)
        self._start = start_host_ns
        self._rng = Random(f"{options.seed}/scheduler")
        self._downlink = Wire(options.downlink, start_host_ns, Random(f"{options.seed}/downlink"))
        self._uplink = Wire(options.uplink, start_host_ns, Random(f"{options.seed}/uplink"))
        self._listener = Listener()
        self._speaker = Speaker(options.autopilot.system_id, options.autopilot.component_id)
        self._down_until = start_host_ns
        self._out: list[tuple[int, bytes]] = []
        self.heard: dict[str, int] = {}
        """How many of each message came in."""
        self.timesync = Timesync(self, start_host_ns)
        self.parameters = Parameters(self)
        self.precland = PrecisionLanding(self, scene)
        self.others = Others(self, start_host_ns)
        if options.gimbal.device_id > BEHIND_AUTOPILOT:
            GimbalComponent(self, self.belief.gimbal, start_host_ns)
        self._handlers = self._table()
        self._begin(start_host_ns)

    def on_bytes(self, data: bytes, now_ns: int) -> None:
        """The companion sent this now; it arrives when the uplink lets it."""
        for arrival_ns, piece in self._uplink.carry(data, now_ns):
            self.agenda.at(arrival_ns, partial(self._receive, piece))

    @property
    def wake_at(self) -> int | None:
        """When something happens next."""
        return self.agenda.wake_at

    def advance(self, now_ns: int) -> list[tuple[int, bytes]]:
        """Everything up to now; each piece of bytes with the instant at which it arrives at the companion."""
        self.agenda.run(now_ns)
        out, self._out = self._out, []
        return out

    def say(self, name: str, fields: dict[str, Any], at_ns: int) -> None:
        """Sends a message of the autopilot."""
        if at_ns >= self._down_until:
            self.put(self._speaker.frame(name, fields), at_ns)

    def put(self, frame: bytes, at_ns: int) -> None:
        """Hands a frame, whoever made it, to the wire."""
        self._out.extend(self._downlink.carry(frame, at_ns))

    def send(self, name: str, at_ns: int) -> bool:
        """Sends what this message says now; False where there is nothing to say."""
        fields = self.telemetry.fields(name, at_ns)
        if fields is None:
            return False
        self.say(name, fields, at_ns)
        return True

    def tell(self, severity: int, text: str, at_ns: int) -> None:
        """STATUSTEXT."""
        self.say("STATUSTEXT", {"severity": severity, "text": text.encode()[:50]}, at_ns)

    def set_rate(self, name: str, rate_hz: float, now_ns: int) -> None:
        """From now on so often; whatever ran before ends."""
        if not self.telemetry.knows(name):
            return
        generation = self.streams.set_rate(name, rate_hz)
        interval_ns = self.streams.interval_ns(name)
        if interval_ns:
            self._schedule(name, now_ns + interval_ns, generation)

    def arm(self, armed: bool, at_ns: int, /) -> None:
        """Arming moves home to where the vehicle stands."""
        if armed == self.telemetry.armed:
            return
        self.telemetry.armed = armed
        self.send("HEARTBEAT", at_ns)
        if armed:
            self.send("HOME_POSITION", at_ns)

    def reboot(self, at_ns: int) -> None:
        """Silent for a while; then the boot clock starts again, with the default rates, on the same flight."""
        back_ns = at_ns + round(self.options.others.reboot_takes_s * 1e9)
        self._down_until = back_ns
        for name in list(self.streams.rates_hz):
            self.streams.set_rate(name, 0.0)
        self.agenda.at(back_ns, self._back)

    def _back(self, at_ns: int) -> None:
        self.clock.reboot(at_ns)
        self._listener = Listener()
        self._start_streams(at_ns)
        self.tell(6, "ArduPlane V4.7.0 (mock)", at_ns)

    def _begin(self, start_ns: int) -> None:
        self._start_streams(start_ns)
        o = self.options
        if o.autopilot.arms_at_s is not None:
            self.agenda.at(start_ns + round(o.autopilot.arms_at_s * 1e9), partial(self.arm, True))
        if o.autopilot.gps and o.autopilot.gps_fix_at_s > 0.0:
            self.agenda.at(start_ns + round(o.autopilot.gps_fix_at_s * 1e9), self._fix)
        for reboot_s in o.others.reboots_at_s:
            self.agenda.at(start_ns + round(reboot_s * 1e9), self.reboot)

    def _fix(self, at_ns: int) -> None:
        self.send("GPS_GLOBAL_ORIGIN", at_ns)
        self.send("HOME_POSITION", at_ns)

    def _start_streams(self, at_ns: int) -> None:
        for name, rate_hz in self.streams.defaults_hz.items():
            if not self.telemetry.knows(name):
                continue
            generation = self.streams.set_rate(name, rate_hz)
            interval_ns = self.streams.interval_ns(name)
            if interval_ns:
                self._schedule(name, at_ns + round(self._rng.random() * interval_ns), generation)

    def _schedule(self, name: str, due_ns: int, generation: int) -> None:
        """Sent within a scheduler loop after it is due; the next one counts from when it was due."""
        loop_s = 1.0 / self.options.autopilot.loop_rate_hz
        at_ns = due_ns + round(self._rng.uniform(0.0, loop_s) * 1e9)

        def send(at: int) -> None:
            if self.streams.generation.get(name) != generation:
                return
            self.send(name, at)
            self._schedule(name, due_ns + self.streams.interval_ns(name), generation)

        self.agenda.at(at_ns, send)

    def _receive(self, piece: bytes, at_ns: int) -> None:
        if at_ns < self._down_until:
            return
        for heard in self._listener.feed(piece):
            self.heard[heard.name] = self.heard.get(heard.name, 0) + 1
            if heard.name in self._handlers and self._is_for_us(heard):
                self._handlers[heard.name](heard, at_ns)

    def _is_for_us(self, heard: Heard) -> bool:
        o = self.options.autopilot
        system, component = heard.fields.get("target_system", 0), heard.fields.get("target_component", 0)
        return system == 0 or (system == o.system_id and component in (0, o.component_id))

    def _table(self) -> dict[str, Handler]:
        commands = Commands(self)
        return {
            "TIMESYNC": self._hear_timesync,
            "COMMAND_LONG": commands.hear,
            "COMMAND_INT": commands.hear,
            "REQUEST_DATA_STREAM": commands.data_stream,
            "PARAM_REQUEST_READ": self.parameters.read,
            "PARAM_REQUEST_LIST": self.parameters.list,
            "PARAM_SET": self.parameters.set,
            "LANDING_TARGET": self.precland.hear,
        }

    def _hear_timesync(self, heard: Heard, now_ns: int) -> None:
        self.others.hear_timesync(heard, now_ns)
        self.timesync.hear(heard, now_ns)
