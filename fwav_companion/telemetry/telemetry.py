"""The adopted autopilot's telemetry as a vehicle whose state can be queried at any recent instant."""

from __future__ import annotations

from typing import Literal

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, BootNs, HostNs, ns_from_s
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.telemetry.attitude.history import KEPT_NS
from fwav_companion.telemetry.attitude.sources import EULER
from fwav_companion.telemetry.attitude.stamp_delay import AttitudeStamps
from fwav_companion.telemetry.barometer import Barometer
from fwav_companion.telemetry.clock.boot_time import BootTimeline, Restarted, Skipped, Strange
from fwav_companion.telemetry.clock.clock import Clock
from fwav_companion.telemetry.clock.clock_news import ClockSlipped
from fwav_companion.telemetry.events import ClockContradicted, GimbalUnused, Rebooted, TelemetryEvent
from fwav_companion.telemetry.gimbal import Gimbal
from fwav_companion.telemetry.gimbal_reading import MESSAGE as GIMBAL_MESSAGE
from fwav_companion.telemetry.intake import Intake
from fwav_companion.telemetry.position_bias import PositionBias
from fwav_companion.telemetry.rate_meter import RateMeter
from fwav_companion.telemetry.vehicle_history import VehicleHistory
from fwav_companion.telemetry.world import World
from fwav_companion.types import (
    AttitudeSample,
    AutopilotKind,
    ClockExchange,
    Message,
    RangeSample,
    Reason,
    ReportedGimbal,
    Unpaired,
    VehicleState,
)
from fwav_companion.types.flight_status import TelemetryReport
from fwav_companion.types.messages import ATTITUDE_MESSAGES

NEWEST_EVERY_NS = NS_PER_S // 10
"""Interval between used attitudes where no attitude is interpolated: each costs as much as routing a frame."""


class TelemetryOptions(msgspec.Struct, frozen=True, kw_only=True):
    """Options of the vehicle's telemetry and its stamps."""

    position: Literal["auto", "none"] = "auto"
    """``auto``: the global position, else the autopilot's local one where its filter vouches for it, else none.
    ``none``: targets are relative to the point below the camera."""
    local_drift: float = 0.01
    """One sigma of the drift of a local position, of the way flown."""
    attitude_message: Literal["auto", "ATTITUDE", "ATTITUDE_QUATERNION"] = "auto"
    """Message that is used; ``auto``: ATTITUDE_QUATERNION once it is received, ATTITUDE before or if it is refused."""
    position_delay_s: float = 0.0
    """Age of a position at its stamp, seconds."""
    position_bias_by_receiver: bool = True
    """Whether vehicle states contain the position error that the receiver reports."""
    attitude_stamp_delay_s: Literal["auto"] | float = "auto"
    """Largest age of an attitude at its stamp, seconds, or auto."""
    attitudes_kept_s: float = KEPT_NS / NS_PER_S
    """Time for which attitudes are stored, seconds: as late frames need, or a whole experiment. 0: only the present
    attitude is needed, so that one every NEWEST_EVERY_NS is enough."""
    clock_rate: float = 1.0
    """Rate of the autopilot's clock, autopilot seconds per host second; used where the clock is estimated from arrivals
    alone."""
    gimbal_device_id: int = 0
    """Gimbal that carries the camera: 1 to 6 behind the autopilot, else its MAVLink component; 0: no gimbal."""
    gimbal_levelled: Literal["auto"] | bool = "auto"
    """Whether a gimbal's roll and pitch count from the horizon; ``auto``: by its flags and its motion."""
    gimbal_delay_s: float = 0.0
    """Age of a gimbal's attitude at its stamp, seconds."""


class Telemetry:
    """Vehicle state from the messages of the adopted autopilot and the clock exchanges that it answered.

    Methods that return events return each event once.
    """

    def __init__(self, options: TelemetryOptions | None = None) -> None:
        self._options = options or TelemetryOptions()
        self._reboots = 0
        self._begin()

    def _begin(self) -> None:
        options = self._options
        self.clock = Clock(options.clock_rate)
        self.world = World(use_position=options.position != "none")
        self._timeline = BootTimeline()
        self._stamps = AttitudeStamps(options.attitude_stamp_delay_s)
        device_id = options.gimbal_device_id
        self._gimbal = None
        if device_id:
            self._gimbal = Gimbal(
                device_id, options.clock_rate, levelled=options.gimbal_levelled, delay_s=options.gimbal_delay_s
            )
        bias = PositionBias() if options.position_bias_by_receiver else None
        self._kept = VehicleHistory(
            self.clock,
            self._stamps,
            self._gimbal,
            ns_from_s(options.attitudes_kept_s),
            barometer=Barometer(),
            position_bias=bias,
            local_drift=options.local_drift,
        )
        self._intake = Intake(
            self._kept,
            self.clock,
            self.world,
            self._stamps,
            attitude_message=options.attitude_message,
            position_delay_s=options.position_delay_s,
        )
        self._meter = RateMeter()
        self._attitude_due_ns: dict[str, HostNs] = {}
        self._unused_gimbal: int | None = None

    def start_over(self) -> None:
        """Forget the vehicle: its samples, clock, origin and home. Another autopilot was adopted."""
        self._begin()

    # Inputs.

    def on_message(self, message: Message, arrival_ns: HostNs) -> tuple[TelemetryEvent, ...]:
        """Take one message; messages without a handler are ignored."""
        handler = self._intake.handlers.get(message.name)
        if handler is None:
            return ()
        self._meter.count(message.name, arrival_ns)
        if self._options.attitudes_kept_s == 0.0 and self._is_spare(message.name, arrival_ns):
            return ()
        wake_at = self.world.wake_at
        events: tuple[TelemetryEvent, ...] = ()
        if wake_at is not None and arrival_ns >= wake_at:
            events = self.world.on_wake(arrival_ns)
        stamp_ms = getattr(message.fields, "time_boot_ms", None)
        if stamp_ms is not None:
            placed = self._timeline.place(stamp_ms, arrival_ns)
            if isinstance(placed, Strange):
                self._intake.refuse(message.name)
                return events
            if isinstance(placed, Restarted | Skipped):
                events += self._on_jump(placed, arrival_ns)
                placed = placed.boot_ns
            self._intake.stamp_ns = placed
            if self.clock.on_arrival(placed, arrival_ns, message.link):
                events += (ClockContradicted(),)
        return events + handler(message.fields, arrival_ns)

    def on_gimbal(
        self,
        message: Message,
        autopilot_component: int,
        arrival_ns: HostNs,
        kind: AutopilotKind = AutopilotKind.OTHER,
    ) -> tuple[TelemetryEvent, ...]:
        """Take a message of any component of the vehicle; it is used if it is from the gimbal. ``kind``: the
        autopilot.
        """
        if self._gimbal is None:
            return self._on_unused_gimbal(message, autopilot_component)
        if not self._gimbal.is_meant(message, autopilot_component):
            return ()
        self._meter.count(message.name, arrival_ns)
        if message.name == GIMBAL_MESSAGE:
            self._gimbal.on_message(message.fields, arrival_ns)
        else:
            self._gimbal.on_older_message(message, self.clock, arrival_ns, kind)
        return self._gimbal.compare(self._kept.attitudes.at, self.clock)

    def _on_unused_gimbal(self, message: Message, autopilot_component: int) -> tuple[TelemetryEvent, ...]:
        """Report, once, a gimbal that is received while none is configured."""
        if self._unused_gimbal is not None:
            return ()
        behind = message.component == autopilot_component
        self._unused_gimbal = getattr(message.fields, "gimbal_device_id", 0) or 1 if behind else message.component
        return (GimbalUnused(self._unused_gimbal),)

    def on_exchange(self, exchange: ClockExchange) -> tuple[TelemetryEvent, ...]:
        """Take one answered TIMESYNC request."""
        placed = self._timeline.align(exchange.autopilot_ns, exchange.received_ns)
        if isinstance(placed, Strange):
            return ()
        events: tuple[TelemetryEvent, ...] = ()
        if isinstance(placed, Restarted | Skipped):
            events = self._on_jump(placed, exchange.received_ns)
            placed = self._timeline.align(exchange.autopilot_ns, exchange.received_ns)
            assert isinstance(placed, int)  # noqa: S101  (the time line began at this instant)
        news = self.clock.on_exchange(msgspec.structs.replace(exchange, autopilot_ns=placed))
        return events if news is None else (*events, news)

    @property
    def wake_at(self) -> HostNs | None:
        """Instant at which :meth:`on_wake` has work; None without any."""
        return self.world.wake_at

    def on_wake(self, now: HostNs) -> tuple[TelemetryEvent, ...]:
        """Do the work that is due."""
        wake_at = self.world.wake_at
        return self.world.on_wake(now) if wake_at is not None and now >= wake_at else ()

    # Queries.

    def state_at(self, boot_ns: BootNs) -> VehicleState | Unpaired:
        """Vehicle state at this instant, or the reason why its attitude is not known."""
        return self._kept.state_at(boot_ns)

    def attitudes_after(self, boot_ns: BootNs) -> list[AttitudeSample]:
        """Stored attitudes later than the instant, as sent, in order of time."""
        return self._kept.attitudes_after(boot_ns)

    def positions_after(self, boot_ns: BootNs) -> list[tuple[BootNs, bool]]:
        """Instants of the stored positions later than the instant, in order, and whether the position jumped there."""
        return self._kept.positions_after(boot_ns)

    def ranges_after(self, boot_ns: BootNs) -> list[RangeSample]:
        """Stored readings of the rangefinder later than the instant, in order of time."""
        return self._kept.ranges_after(boot_ns)

    def gimbal_at(self, boot_ns: BootNs) -> ReportedGimbal | Reason:
        """Attitude between two reports of the gimbal that carries the camera, or the reason why it is not known."""
        return self._kept.gimbal_at(boot_ns)

    def ready_for(self, boot_ns: BootNs) -> bool:
        """Whether enough attitudes lie beyond this instant: waiting longer does not improve the answer."""
        return self._kept.ready_for(boot_ns)

    def newest_state(self) -> VehicleState | Unpaired:
        """Vehicle state at the latest attitude."""
        return self._kept.newest_state()

    @property
    def attitudes(self) -> tuple[AttitudeSample, ...]:
        """All stored attitudes as sent, in order of time."""
        return self._kept.attitudes.samples

    def local_position_at(self, boot_ns: BootNs) -> Vector3 | None:
        """Autopilot's LOCAL_POSITION_NED at the instant, metres from the autopilot's own origin. Its frame differs from
        the service's local NED.
        """
        return self._kept.local_position_at(boot_ns)

    def moved_between(self, start_ns: BootNs, end_ns: BootNs) -> Vector3 | None:
        """The vehicle's way from one instant to a later one by its reported velocities, NED, metres."""
        return self._kept.positions.way_between(start_ns, end_ns)

    @property
    def undulation_m(self) -> float | None:
        """Geoid above ellipsoid at the vehicle from its receiver, metres; None where the receiver has no such value."""
        return self._intake.undulation_m

    @property
    def utc_minus_host_s(self) -> float | None:
        """UTC minus host clock from SYSTEM_TIME, seconds; None while the autopilot does not know UTC or its clock is
        unknown.
        """
        if self._intake.utc is None:
            return None
        unix_ns, boot_ns = self._intake.utc
        host_ns = self.clock.host_from_boot(boot_ns)
        return None if isinstance(host_ns, Unpaired) else (unix_ns - host_ns) * 1e-9

    def message_hz(self, name: str, now: HostNs) -> float:
        """Rate at which a message that is used arrives, Hz."""
        return self._meter.rates_hz(now).get(name, 0.0)

    def attitude_hz(self, now: HostNs) -> float:
        """Rate of the message from which attitudes are taken, Hz; 0 while none arrive."""
        return self._meter.rates_hz(now).get(self._intake.choice.source or "", 0.0)

    @property
    def stamp_delay_s(self) -> float:
        """Largest assumed age of an attitude at its stamp, seconds."""
        return self._stamps.delay_s

    def status(self, now: HostNs) -> TelemetryReport:
        """Part of the status: rates, the attitude stream, the world and the gimbal."""
        attitudes, source = self._kept.attitudes, self._intake.choice.source
        return TelemetryReport(
            **msgspec.structs.asdict(attitudes.quality.status()),
            rates_hz=self._meter.rates_hz(now),
            attitude_source=source,
            attitudes_kept=len(attitudes),
            attitude_stamp_delay_s=self._stamps.delay_s,
            attitude_stamps_in_step=self._stamps.in_step,
            pitch_trim_undone_deg=self._intake.trim_undone_deg if source == EULER else None,
            relative_world=self.world.relative,
            position=self.world.position_in_use,
            local_trouble=self.world.filter_status.local_trouble,
            height_source=self._kept.height_source,
            barometer_starts_in_air=self._kept.barometer.starts_in_air,
            home_down_m=self.world.home_down_m,
            refused=dict(self._intake.refused),
            reboots=self._reboots,
            gimbal_unused=self._unused_gimbal,
            gimbal=None if self._gimbal is None else self._gimbal.status(now),
        )

    # Steps.

    def _is_spare(self, name: str, arrival_ns: HostNs) -> bool:
        """Whether an attitude is skipped, because only the present one is needed and the last one is recent."""
        if name not in ATTITUDE_MESSAGES:
            return False
        if arrival_ns < self._attitude_due_ns.get(name, 0):
            return True
        self._attitude_due_ns[name] = HostNs(arrival_ns + NEWEST_EVERY_NS)
        return False

    def _on_jump(self, placed: Restarted | Skipped, now: HostNs) -> tuple[TelemetryEvent, ...]:
        """Handle a jump of the stamps: start again after a reboot; after a jump ahead keep the state, and follow."""
        if isinstance(placed, Skipped):
            answered = self.clock.estimate(now).round_trip_s is not None
            self.clock.skip()
            return () if answered else (ClockSlipped(-placed.ahead_ns / NS_PER_S),)
        self.clock.reset()
        self._kept.clear()
        self._intake.utc = None
        self._reboots += 1
        return (Rebooted(now, self.world.on_reboot()),)
