"""The mock autopilot, pure: timed bytes in, timed bytes out. Real and simulated time both run it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from random import Random

from sitl_mock.agenda import Agenda
from sitl_mock.belief import Belief
from sitl_mock.broadcast import Broadcast
from sitl_mock.clock import BootClock
from sitl_mock.codec import Heard, Listener
from sitl_mock.commands import Commands
from sitl_mock.draws import DrawnBiases
from sitl_mock.earth import World
from sitl_mock.flight import Flight
from sitl_mock.follow_mode import FollowMode
from sitl_mock.gimbal import BEHIND_AUTOPILOT
from sitl_mock.gimbal_component import GimbalComponent
from sitl_mock.gimbal_manager import GimbalManager
from sitl_mock.lander import Lander
from sitl_mock.options import Options
from sitl_mock.others import Others
from sitl_mock.parameters import Parameters
from sitl_mock.precland import PrecisionLanding
from sitl_mock.radio import Radio
from sitl_mock.scene import Target
from sitl_mock.telemetry import Telemetry
from sitl_mock.timesync import Timesync
from sitl_mock.wire import Wire

Handler = Callable[[Heard, int], None]
REBOOT_AFTER_NS = 100_000_000
"""Delay of a reboot, nanoseconds: the command is acknowledged first."""
LOITER, LAND = 5, 9
"""Flight modes of a copter."""
DISARM_DELAY_S = 1.5
"""Time on the ground after which a copter in LAND disarms."""
WATCHED_EVERY_NS = 50_000_000


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
        lander: Lander | None = None,
    ) -> None:
        self._o, self._clock, self._agenda = options, clock, Agenda()
        self._uplink = Wire(options.uplink, start_host_ns, Random(f"{options.seed}/uplink"))
        self._listener = Listener()
        self._radio = radio = Radio(options, start_host_ns)
        self.heard: dict[str, int] = {}
        """Number of received messages by name."""
        self.belief = Belief(options, biases, flight, world)
        self._telemetry = Telemetry(options, self.belief, clock, start_host_ns)
        self._telemetry.utc_minus_host_s = unix_minus_host_s + options.autopilot.utc_minus_host_wall_s
        self._broadcast = Broadcast(options, self._telemetry, self._agenda, radio)
        flight_s = self._telemetry.flight_s
        self.timesync = Timesync(options, clock, self._agenda, radio, start_host_ns)
        self.precland = PrecisionLanding(
            options.autopilot, self.belief, scene, flight_s, self.timesync.peer_ns, radio, lander
        )
        self._lander = lander
        self._others = Others(options, self._broadcast, flight_s, self._agenda, radio, start_host_ns)
        if options.gimbal.device_id > BEHIND_AUTOPILOT:
            GimbalComponent(options, self.belief.gimbal, flight_s, self._agenda, radio, start_host_ns)
        self.gimbal_manager = GimbalManager(options, self.belief, flight_s, self._agenda, radio)
        if options.gimbal.manager:
            self.gimbal_manager.start(start_host_ns + 150_000_000)
        self.follow = FollowMode(options, self.belief, flight_s)
        self._handlers = self._table()
        self._begin(start_host_ns)

    def on_bytes(self, data: bytes, now_ns: int) -> None:
        """Accepts bytes that the companion sends at this instant; the uplink decides when they arrive."""
        for arrival_ns, piece in self._uplink.carry(data, now_ns):
            self._agenda.at(arrival_ns, partial(self._receive, piece))

    @property
    def wake_at(self) -> int | None:
        """Instant of the next action."""
        return self._agenda.wake_at

    def advance(self, now_ns: int) -> list[tuple[int, bytes]]:
        """Runs the vehicle up to now; returns each piece of bytes with its instant of arrival at the companion."""
        self._agenda.run(now_ns)
        return self._radio.taken()

    @property
    def rates_hz(self) -> dict[str, float]:
        """Present rate of every stream, by message."""
        return self._broadcast.streams.rates_hz

    def _begin(self, start_ns: int) -> None:
        o = self._o
        self._telemetry.armed = o.autopilot.arms_at_s is not None and o.autopilot.arms_at_s <= 0.0
        self._broadcast.start(start_ns)
        if o.autopilot.disarms_at_s is not None:
            self._agenda.at(start_ns + round(o.autopilot.disarms_at_s * 1e9), partial(self._arm, False))
        if o.autopilot.arms_at_s is not None:
            self._agenda.at(start_ns + round(o.autopilot.arms_at_s * 1e9), partial(self._arm, True))
        if o.autopilot.gps and o.autopilot.gps_fix_at_s > 0.0:
            self._agenda.at(start_ns + round(o.autopilot.gps_fix_at_s * 1e9), self._fix)
        for at_s, change in (
            (o.autopilot.mode_changes_at_s, self._change_mode),
            (o.autopilot.status_changes_at_s, self._change_status),
        ):
            if at_s:
                self._agenda.at(start_ns + round(at_s * 1e9), change)
        if self._lander is not None:
            self._telemetry.mode = LOITER
            self._agenda.at(start_ns + round(o.lander.at_s * 1e9), self._land)
        for reboot_s in o.others.reboots_at_s:
            self._agenda.at(start_ns + round(reboot_s * 1e9), self._reboot)

    def _fix(self, at_ns: int) -> None:
        self._broadcast.send("GPS_GLOBAL_ORIGIN", at_ns)
        self._broadcast.send("HOME_POSITION", at_ns)

    def _change_mode(self, at_ns: int) -> None:
        self._telemetry.mode_changed = True
        self._broadcast.send("HEARTBEAT", at_ns)

    def _land(self, at_ns: int) -> None:
        self._telemetry.mode = LAND
        self._broadcast.send("HEARTBEAT", at_ns)
        if self._lander is not None:
            self._watch_landing(self._lander, at_ns)

    def _watch_landing(self, lander: Lander, at_ns: int) -> None:
        """Sends the lander's texts, and disarms it once it is down."""
        self.precland.report(at_ns)
        touchdown = lander.touchdown
        if touchdown is not None and self._telemetry.flight_s(at_ns) - touchdown.at_s > DISARM_DELAY_S:
            self._arm(False, at_ns)
            return
        self._agenda.at(at_ns + WATCHED_EVERY_NS, partial(self._watch_landing, lander))

    def _change_status(self, at_ns: int) -> None:
        self._telemetry.status = self._o.autopilot.status_then
        self._broadcast.send("HEARTBEAT", at_ns)

    def _arm(self, armed: bool, at_ns: int, /) -> None:
        """Arms or disarms; arming moves home."""
        if armed == self._telemetry.armed:
            return
        self._telemetry.armed = armed
        self._broadcast.send("HEARTBEAT", at_ns)
        if armed:
            self._broadcast.send("HOME_POSITION", at_ns)

    def _reboot_soon(self, now_ns: int) -> None:
        self._agenda.at(now_ns + REBOOT_AFTER_NS, self._reboot)

    def _reboot(self, at_ns: int) -> None:
        """Reboots: silent for a while; then the boot clock restarts with the default rates, and the flight
        continues.
        """
        back_ns = at_ns + round(self._o.others.reboot_takes_s * 1e9)
        self._radio.down_until(back_ns)
        self._broadcast.stop()
        self._agenda.at(back_ns, self._back)

    def _back(self, at_ns: int) -> None:
        self._clock.reboot(at_ns)
        self._listener = Listener()
        self._broadcast.start(at_ns)
        self._radio.statustext(6, "ArduPlane V4.7.0 (mock)", at_ns)

    def _receive(self, piece: bytes, at_ns: int) -> None:
        if self._radio.is_down(at_ns):
            return
        for heard in self._listener.feed(piece):
            self.heard[heard.name] = self.heard.get(heard.name, 0) + 1
            if heard.name in self._handlers and self._answers(heard.name) and self._is_for_us(heard):
                self._handlers[heard.name](heard, at_ns)

    def _answers(self, name: str) -> bool:
        answers = self._o.autopilot.answers
        return answers in {"all", "ack_only"} or (answers == "groups_only" and name == "REQUEST_DATA_STREAM")

    def _is_for_us(self, heard: Heard) -> bool:
        o = self._o.autopilot
        system, component = heard.fields.get("target_system", 0), heard.fields.get("target_component", 0)
        return system == 0 or (system == o.system_id and component in (0, o.component_id))

    def _table(self) -> dict[str, Handler]:
        autopilot = self._o.autopilot
        more = self._broadcast.streams.parameters()
        more |= {f"MORE_{number}": float(number) for number in range(autopilot.more_parameters)}
        parameters = Parameters(autopilot, self._agenda, self._radio, more)
        manager = self.gimbal_manager if self._o.gimbal.manager else None
        commands = Commands(autopilot, self._broadcast, self._radio, self._arm, self._reboot_soon, manager)
        return {
            "TIMESYNC": self._hear_timesync,
            "COMMAND_LONG": commands.hear,
            "COMMAND_INT": commands.hear,
            "REQUEST_DATA_STREAM": commands.data_stream,
            "PARAM_REQUEST_READ": parameters.read,
            "PARAM_REQUEST_LIST": parameters.list,
            "PARAM_SET": parameters.set,
            "LANDING_TARGET": self.precland.hear,
            "FOLLOW_TARGET": self.follow.hear,
            **({} if manager is None else {"GIMBAL_MANAGER_SET_PITCHYAW": manager.set_pitchyaw}),
        }

    def _hear_timesync(self, heard: Heard, now_ns: int) -> None:
        self._others.hear_timesync(heard, now_ns)
        self.timesync.hear(heard, now_ns)
