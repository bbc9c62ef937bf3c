"""Everything the adopted autopilot tells, as a vehicle that can be asked where it was at any instant."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec

from fwav_companion.geometry.earth import Geodetic
from fwav_companion.geometry.stamps import NS_PER_S, BootNs, HostNs, ns_from_s
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.nouns import (
    AttitudeSample,
    ClockExchange,
    HeightSource,
    Message,
    RangeSample,
    Unpaired,
    VehicleState,
)
from fwav_companion.telemetry import decoding
from fwav_companion.telemetry.boot_time import BootTimeline, Restarted, Strange
from fwav_companion.telemetry.clock import Clock
from fwav_companion.telemetry.courses import Course, Latest
from fwav_companion.telemetry.decoding import Implausible
from fwav_companion.telemetry.events import PitchTrimUndone, Rebooted, StampDelay, TelemetryEvent
from fwav_companion.telemetry.gimbal import Gimbal
from fwav_companion.telemetry.history import KEPT_NS, AttitudeHistory
from fwav_companion.telemetry.meter import RateMeter
from fwav_companion.telemetry.pitch_trim import PitchTrim
from fwav_companion.telemetry.sources import EULER, AttitudeChoice
from fwav_companion.telemetry.stamp_delay import HALF_MS_NS, AttitudeStamps
from fwav_companion.telemetry.world import World

RANGE_NEAR_NS = 200_000_000
"""A rangefinder reading this near is of the same moment; they come at 10 Hz and more."""
TERRAIN_NEAR_NS = 2_000_000_000
"""TERRAIN_REPORT comes once a second, of ground that the vehicle hardly leaves meanwhile."""


class TelemetryOptions(msgspec.Struct, frozen=True, kw_only=True):
    """What the configuration says about the vehicle and its stamps."""

    position: str = "auto"
    """auto | none."""
    attitude_message: str = "auto"
    """auto | ATTITUDE | ATTITUDE_QUATERNION."""
    position_delay_s: float = 0.0
    """How old a position is against its stamp."""
    attitude_stamp_delay_s: float | str = "auto"
    """An attitude is up to this older than its stamp."""
    attitudes_kept_s: float = KEPT_NS / NS_PER_S
    """For how long attitudes can be asked for: what frames that come late need, or all of an experiment."""
    gimbal_device_id: int = 0
    """Of the gimbal that carries the camera: 1 to 6 behind the autopilot, else its MAVLink component; 0: none does."""


class Telemetry:
    """Fed with the messages of the one adopted autopilot, and with the clock exchanges it answered.

    Every method that hands back events tells each of them once.
    """

    def __init__(self, options: TelemetryOptions | None = None) -> None:
        self._options = options = options or TelemetryOptions()
        self.clock = Clock()
        self.world = World(use_position=options.position != "none")
        self.undulation_m: float | None = None
        """Geoid above ellipsoid by the receiver's own alt_ellipsoid - alt."""
        self._timeline = BootTimeline()
        self._stamp_ns = BootNs(0)
        self._attitudes = AttitudeHistory(ns_from_s(options.attitudes_kept_s))
        self._choice = AttitudeChoice(options.attitude_message)
        self._stamps = AttitudeStamps(options.attitude_stamp_delay_s)
        self._trim = PitchTrim()
        self._trim_undone_deg = 0.0
        self._positions = Course()
        self._local = Course()
        self._heights = {source: Course() for source in HeightSource}
        self._ranges = Latest()
        self._terrain = Latest()
        self._utc: tuple[int, BootNs] | None = None
        self._gimbal = Gimbal(options.gimbal_device_id) if options.gimbal_device_id else None
        self._meter = RateMeter()
        self._refused: dict[str, int] = {}
        self._reboots = 0
        self._handlers: dict[str, Callable[[Any, HostNs], tuple[TelemetryEvent, ...]]] = {
            "ATTITUDE": self._on_attitude,
            "ATTITUDE_QUATERNION": self._on_attitude_quaternion,
            "GLOBAL_POSITION_INT": self._on_position,
            "LOCAL_POSITION_NED": self._on_local_position,
            "DISTANCE_SENSOR": self._on_distance,
            "SYSTEM_TIME": self._on_system_time,
            "ALTITUDE": self._on_altitude,
            "VFR_HUD": self._on_vfr_hud,
            "GPS_RAW_INT": self._on_gps_raw,
            "GPS_GLOBAL_ORIGIN": self._on_global_origin,
            "HOME_POSITION": self._on_home,
            "TERRAIN_REPORT": self._on_terrain,
            "HEARTBEAT": self._on_heartbeat,
            "PARAM_VALUE": self._on_param_value,
            "STATUSTEXT": self._on_statustext,
        }

    # What goes in.

    def on_message(self, message: Message, arrival_ns: HostNs) -> tuple[TelemetryEvent, ...]:
        """Take one message; the ones that tell nothing here are passed over."""
        handler = self._handlers.get(message.name)
        if handler is None:
            return ()
        self._meter.count(message.name, arrival_ns)
        events: tuple[TelemetryEvent, ...] = self.on_wake(arrival_ns)
        stamp_ms = getattr(message.fields, "time_boot_ms", None)
        if stamp_ms is not None:
            placed = self._timeline.place(stamp_ms, arrival_ns)
            if isinstance(placed, Strange):
                self._refuse(message.name)
                return events
            if isinstance(placed, Restarted):
                events += self._restart(arrival_ns)
                placed = placed.boot_ns
            self._stamp_ns = placed
            self.clock.on_arrival(placed, arrival_ns)
        return events + handler(message.fields, arrival_ns)

    def on_gimbal(self, message: Message, autopilot_component: int, arrival_ns: HostNs) -> None:
        """Take a message of any component of the vehicle that may be the gimbal's."""
        if self._gimbal is not None and self._gimbal.is_meant(message, autopilot_component):
            self._meter.count(message.name, arrival_ns)
            self._gimbal.on_message(message.fields, arrival_ns)

    def on_exchange(self, exchange: ClockExchange) -> tuple[TelemetryEvent, ...]:
        """Take one answered TIMESYNC request."""
        aligned_ns = self._timeline.align(exchange.autopilot_ns, exchange.received_ns)
        began_anew = self.clock.on_exchange(ClockExchange(exchange.sent_ns, exchange.received_ns, aligned_ns))
        if not began_anew:
            return ()
        return self._forget_boot(exchange.received_ns)

    @property
    def wake_at(self) -> HostNs | None:
        """When :meth:`on_wake` has something to do."""
        return self.world.wake_at

    def on_wake(self, now: HostNs) -> tuple[TelemetryEvent, ...]:
        """Do what is due."""
        wake_at = self.world.wake_at
        return self.world.on_wake(now) if wake_at is not None and now >= wake_at else ()

    # What can be asked.

    def state_at(self, boot_ns: BootNs) -> VehicleState | Unpaired:
        """The vehicle at this instant, or why its attitude there is not known."""
        attitude = self._attitudes.at(boot_ns)
        if isinstance(attitude, Unpaired):
            return attitude
        position = self._positions.at(boot_ns)
        nearest_range = self._ranges.near(boot_ns, RANGE_NEAR_NS)
        terrain = self._terrain.near(boot_ns, TERRAIN_NEAR_NS)
        return VehicleState(
            boot_ns=boot_ns,
            ned_from_body=attitude.ned_from_body,
            rates=attitude.rates,
            attitude_sigma=attitude.sigma,
            gap_s=attitude.gap_s,
            position_ned=None if position is None else _vector(position.values),
            velocity_ned=None if position is None else _vector(position.rates),
            position_sigma_m=0.0 if position is None else position.sigma,
            height_above_home_m=self._height_at(boot_ns),
            range=nearest_range if isinstance(nearest_range, RangeSample) else None,
            terrain_height_m=terrain if isinstance(terrain, float) else None,
            stamp_sigma_s=self._stamps.sigma_s,
            gimbal=None if self._gimbal is None else self._gimbal.at(boot_ns, self.clock, attitude),
        )

    def ready_for(self, boot_ns: BootNs) -> bool:
        """Enough attitudes lie beyond this instant: waiting longer makes the answer no better."""
        return self._attitudes.ready_for(boot_ns) and (
            self._gimbal is None or self._gimbal.ready_for(boot_ns, self.clock)
        )

    def newest_state(self) -> VehicleState | Unpaired:
        """At the latest attitude."""
        newest = self._attitudes.newest
        return self.state_at(newest.boot_ns if newest else BootNs(0))

    @property
    def attitudes(self) -> tuple[AttitudeSample, ...]:
        """All that are kept, as they were told, in order of time."""
        return self._attitudes.samples

    def local_position_at(self, boot_ns: BootNs) -> Vector3 | None:
        """The autopilot's LOCAL_POSITION_NED there, metres from its own origin: never to be mixed with ours."""
        point = self._local.at(boot_ns)
        return None if point is None else _vector(point.values)

    @property
    def utc_minus_host_s(self) -> float | None:
        """By SYSTEM_TIME; None while the autopilot does not know UTC or its clock is not placed."""
        if self._utc is None:
            return None
        unix_ns, boot_ns = self._utc
        host_ns = self.clock.host_from_boot(boot_ns)
        return None if isinstance(host_ns, Unpaired) else (unix_ns - host_ns) * 1e-9

    def attitude_hz(self, now: HostNs) -> float:
        """How often attitudes come, of the message that they are taken from; 0 while none come."""
        return self._meter.rates_hz(now).get(self._choice.source or "", 0.0)

    @property
    def stamp_delay_s(self) -> float:
        """An attitude is taken to be up to this older than its stamp."""
        return self._stamps.delay_s

    def status(self, now: HostNs) -> dict[str, Any]:
        """For the status file and ``check``."""
        return {
            "rates_hz": self._meter.rates_hz(now),
            "attitude_source": self._choice.source,
            "attitudes_kept": len(self._attitudes),
            **self._attitudes.check.status(),
            "attitude_stamp_delay_s": self._stamps.delay_s,
            "attitude_stamps_in_step": self._stamps.in_step,
            "pitch_trim_undone_deg": self._trim_undone_deg if self._choice.source == EULER else None,
            "relative_world": self.world.relative,
            "home_down_m": self.world.home_down_m,
            "refused": dict(self._refused),
            "reboots": self._reboots,
            "gimbal": None if self._gimbal is None else self._gimbal.status(now),
        }

    # Messages, one by one. `self._stamp_ns` is the placed stamp of the one in hand.

    def _on_attitude(self, fields: Any, now: HostNs) -> tuple[TelemetryEvent, ...]:
        events = self._put_trim_back()
        return events + self._take_attitude(EULER, decoding.attitude_from_euler(fields, self._trim.taken_off), now)

    def _on_attitude_quaternion(self, fields: Any, now: HostNs) -> tuple[TelemetryEvent, ...]:
        return self._take_attitude("ATTITUDE_QUATERNION", decoding.attitude_from_quaternion(fields), now)

    def _take_attitude(
        self, name: str, attitude: decoding.Attitude | Implausible, now: HostNs
    ) -> tuple[TelemetryEvent, ...]:
        if isinstance(attitude, Implausible):
            return self._refuse(name)
        self.world.on_attitude(now)
        wanted, events = self._choice.take(name, now)
        if not wanted:
            return events
        if events:
            self._attitudes.clear()
        boot_ns = BootNs(self._stamp_ns + self._stamps.correction_ns)
        if not self._attitudes.insert(AttitudeSample(boot_ns, attitude.ned_from_body, attitude.rates)):
            self._refuse(name)
        return events + self._move_stamps(self._stamps.on_scatter(self._attitudes.check.stamp_scatter_s))

    def _on_position(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        position = decoding.position(fields)
        if isinstance(position, Implausible):
            return self._refuse("GLOBAL_POSITION_INT")
        events = self.world.on_position(position)
        boot_ns = BootNs(self._stamp_ns + HALF_MS_NS - ns_from_s(self._options.position_delay_s))
        north, east, down = position.velocity_ned
        heights = self._heights[HeightSource.GLOBAL_POSITION_INT]
        heights.insert(boot_ns, (position.height_above_home_m,), (-down,))
        if self.world.plane is not None and position.place is not None:
            self._positions.insert(boot_ns, self.world.plane.ned_from_geodetic(position.place), (north, east, down))
        return events

    def _on_local_position(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        place, velocity = (fields.x, fields.y, fields.z), (fields.vx, fields.vy, fields.vz)
        if not (
            all(abs(c) <= 10.0 * decoding.MOST_HEIGHT_M for c in place)
            and all(abs(c) <= decoding.MOST_SPEED_M_S for c in velocity)
        ):
            return self._refuse("LOCAL_POSITION_NED")
        boot_ns = BootNs(self._stamp_ns + HALF_MS_NS - ns_from_s(self._options.position_delay_s))
        self._local.insert(boot_ns, place, velocity)
        return ()

    def _on_distance(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        sample = decoding.range_sample(fields, BootNs(self._stamp_ns + HALF_MS_NS))
        if isinstance(sample, Implausible):
            return self._refuse("DISTANCE_SENSOR")
        self._ranges.insert(sample.boot_ns, sample)
        return ()

    def _on_system_time(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        unix_ns = decoding.unix_ns(fields)
        if unix_ns is not None:
            self._utc = (unix_ns, BootNs(self._stamp_ns + HALF_MS_NS))
        return ()

    def _on_altitude(self, fields: Any, now: HostNs) -> tuple[TelemetryEvent, ...]:
        return self._take_height(HeightSource.ALTITUDE, fields.altitude_relative, 0.0, now)

    def _on_vfr_hud(self, fields: Any, now: HostNs) -> tuple[TelemetryEvent, ...]:
        home_m = self.world.home_alt_amsl_m
        if home_m is None:
            return ()
        return self._take_height(HeightSource.VFR_HUD, fields.alt - home_m, fields.climb, now)

    def _take_height(
        self, source: HeightSource, height_m: float, climb: float, now: HostNs
    ) -> tuple[TelemetryEvent, ...]:
        height = decoding.finite_height_m(height_m)
        if height is None:
            return self._refuse(source.value)
        rate = float(climb) if abs(climb) <= decoding.MOST_SPEED_M_S else 0.0
        boot_ns = self.clock.boot_from_host(now)
        if not isinstance(boot_ns, Unpaired):
            self._heights[source].insert(boot_ns, (height,), (rate,))
        return ()

    def _on_gps_raw(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        self.world.on_gps_fix(fields.fix_type)
        undulation_m = decoding.undulation_m(fields)
        if undulation_m is not None:
            self.undulation_m = undulation_m
        return ()

    def _on_global_origin(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        place = decoding.geodetic(fields.latitude, fields.longitude, fields.altitude)
        if place is None:
            return self._refuse("GPS_GLOBAL_ORIGIN")
        self.world.on_global_origin(place)
        return ()

    def _on_home(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        place: Geodetic | None = decoding.geodetic(fields.latitude, fields.longitude, fields.altitude)
        if place is None:
            return self._refuse("HOME_POSITION")
        return self.world.on_home(place.alt_amsl_m)

    def _on_terrain(self, fields: Any, now: HostNs) -> tuple[TelemetryEvent, ...]:
        height = decoding.finite_height_m(fields.current_height)
        boot_ns = self.clock.boot_from_host(now)
        if height is None or fields.spacing == 0 or isinstance(boot_ns, Unpaired):  # spacing 0: no terrain data there
            return self._refuse("TERRAIN_REPORT")
        self._terrain.insert(boot_ns, height)
        return ()

    def _on_heartbeat(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        self._trim.on_heartbeat(fields.type)
        return self._move_stamps(self._stamps.on_heartbeat(fields.autopilot, fields.type))

    def _on_param_value(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        self._trim.on_parameter(fields.param_id, fields.param_value)
        return self._move_stamps(self._stamps.on_parameter(fields.param_id, fields.param_value))

    def _on_statustext(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        return self._move_stamps(self._stamps.on_text(fields.text))

    # Steps.

    def _put_trim_back(self) -> tuple[TelemetryEvent, ...]:
        """Where ATTITUDE counts and its trim is another now: what was taken until now lies apart from what comes."""
        if self._choice.source != EULER or self._trim.taken_off_deg == self._trim_undone_deg:
            return ()
        self._trim_undone_deg = self._trim.taken_off_deg
        self._attitudes.clear()
        return (PitchTrimUndone(self._trim_undone_deg),)

    def _move_stamps(self, moved_ns: int) -> tuple[TelemetryEvent, ...]:
        if moved_ns == 0:
            return ()
        self._attitudes.shift(moved_ns)
        return (StampDelay(self._stamps.delay_s, self._stamps.in_step),)

    def _restart(self, now: HostNs) -> tuple[TelemetryEvent, ...]:
        self.clock.reset()
        return self._forget_samples(now)

    def _forget_boot(self, now: HostNs) -> tuple[TelemetryEvent, ...]:
        self._timeline.forget()
        return self._forget_samples(now)

    def _forget_samples(self, now: HostNs) -> tuple[TelemetryEvent, ...]:
        for course in (self._positions, self._local, *self._heights.values()):
            course.clear()
        for latest in (self._ranges, self._terrain):
            latest.clear()
        self._attitudes.clear()
        self._utc = None
        self._reboots += 1
        return (Rebooted(now),)

    def _height_at(self, boot_ns: BootNs) -> float | None:
        for course in self._heights.values():  # in order of preference
            point = course.at(boot_ns)
            if point is not None:
                return point.values[0]
        return None

    def _refuse(self, name: str) -> tuple[TelemetryEvent, ...]:
        self._refused[name] = self._refused.get(name, 0) + 1
        return ()


def _vector(values: tuple[float, ...]) -> Vector3:
    a, b, c = values
    return (a, b, c)
