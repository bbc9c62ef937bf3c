"""Stores each message of the autopilot in the vehicle's history."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fwav_companion.geometry.earth import Geodetic
from fwav_companion.geometry.stamps import BootNs, HostNs, ns_from_s
from fwav_companion.geometry.vectors import Vector3, add
from fwav_companion.telemetry import decoding
from fwav_companion.telemetry.attitude.pitch_trim import PitchTrim
from fwav_companion.telemetry.attitude.sources import EULER, AttitudeChoice
from fwav_companion.telemetry.attitude.stamp_delay import HALF_MS_NS, AttitudeStamps
from fwav_companion.telemetry.barometer import altitude_of_pressure_m
from fwav_companion.telemetry.climb import ClimbCheck
from fwav_companion.telemetry.clock.clock import Clock
from fwav_companion.telemetry.decoding import Implausible
from fwav_companion.telemetry.events import (
    OriginSet,
    PitchTrimUndone,
    PositionJumped,
    PositionSource,
    StampDelay,
    TelemetryEvent,
)
from fwav_companion.telemetry.odometry import OdometryPosition, OdometryReader
from fwav_companion.telemetry.position_jump import PositionJumps
from fwav_companion.telemetry.vehicle_history import VehicleHistory
from fwav_companion.telemetry.world import World
from fwav_companion.types import AttitudeSample, HeightSource, Unpaired

SAFETY_ARMED = 128
"""MAV_MODE_FLAG_SAFETY_ARMED."""


class Intake:
    """Handlers of messages by name; an implausible message is rejected and counted."""

    def __init__(
        self,
        kept: VehicleHistory,
        clock: Clock,
        world: World,
        stamps: AttitudeStamps,
        *,
        attitude_message: str,
        position_delay_s: float,
    ) -> None:
        """``position_delay_s``: age of a position at its stamp."""
        self._kept = kept
        self._clock = clock
        self._world = world
        self._stamps = stamps
        self._position_delay_ns = ns_from_s(position_delay_s)
        self._trim = PitchTrim()
        self._jumps = PositionJumps()
        self._climbs = ClimbCheck()
        self._odometry = OdometryReader(clock)
        self.choice = AttitudeChoice(attitude_message)
        """Choice of the message from which attitudes are taken."""
        self._trials = 0
        """Number of trials of the attitude stream at which the scatter of stamps was last used."""
        self.trim_undone_deg = 0.0
        """Trim added to the pitch of ATTITUDE, degrees."""
        self.stamp_ns = BootNs(0)
        """Placed stamp of the current message."""
        self.undulation_m: float | None = None
        """Geoid above ellipsoid, metres, from the receiver's alt_ellipsoid - alt."""
        self.utc: tuple[int, BootNs] | None = None
        """UTC in Unix nanoseconds and its boot instant; None while the autopilot does not know UTC."""
        self._jumped_utc: tuple[int, BootNs] | None = None
        """The newest UTC that disagreed with the one in use, until another shows which is right."""
        self.refused: dict[str, int] = {}
        """Counts of rejected messages by name."""
        self.handlers: dict[str, Callable[[Any, HostNs], tuple[TelemetryEvent, ...]]] = {
            "ATTITUDE": self._on_attitude,
            "ATTITUDE_QUATERNION": self._on_attitude_quaternion,
            "GLOBAL_POSITION_INT": self._on_position,
            "LOCAL_POSITION_NED": self._on_local_position,
            "ODOMETRY": self._on_odometry,
            "DISTANCE_SENSOR": self._on_distance,
            "SYSTEM_TIME": self._on_system_time,
            "ALTITUDE": self._on_altitude,
            "VFR_HUD": self._on_vfr_hud,
            "SCALED_PRESSURE": self._on_pressure,
            "GPS_RAW_INT": self._on_gps_raw,
            "EKF_STATUS_REPORT": self._on_ardupilot_filter,
            "ESTIMATOR_STATUS": self._on_px4_filter,
            "EXTENDED_SYS_STATE": self._on_extended_state,
            "GPS_GLOBAL_ORIGIN": self._on_global_origin,
            "HOME_POSITION": self._on_home,
            "TERRAIN_REPORT": self._on_terrain,
            "HEARTBEAT": self._on_heartbeat,
            "PARAM_VALUE": self._on_param_value,
            "STATUSTEXT": self._on_statustext,
        }
        """Handlers by message name. Arguments: fields and arrival; the stamp, if there is one, is :attr:`stamp_ns`."""

    def refuse(self, name: str) -> tuple[TelemetryEvent, ...]:
        """Count a message without a usable value."""
        self.refused[name] = self.refused.get(name, 0) + 1
        return ()

    # Handlers.

    def _on_attitude(self, fields: Any, now: HostNs) -> tuple[TelemetryEvent, ...]:
        events = () if self._trim.correction_deg == self.trim_undone_deg else self._put_trim_back()
        return events + self._take_attitude(EULER, decoding.attitude_from_euler(fields, self._trim.correction), now)

    def _on_attitude_quaternion(self, fields: Any, now: HostNs) -> tuple[TelemetryEvent, ...]:
        return self._take_attitude("ATTITUDE_QUATERNION", decoding.attitude_from_quaternion(fields), now)

    def _take_attitude(
        self, name: str, attitude: decoding.Attitude | Implausible, now: HostNs
    ) -> tuple[TelemetryEvent, ...]:
        if isinstance(attitude, Implausible):
            return self.refuse(name)
        self._world.on_attitude(now)
        wanted, events = self.choice.take(name, now)
        if not wanted:
            return events
        if events:
            self._kept.attitudes.clear()
        boot_ns = BootNs(self.stamp_ns + self._stamps.correction_ns)
        attitudes = self._kept.attitudes
        if not attitudes.insert(AttitudeSample(boot_ns, attitude.ned_from_body, attitude.rates)):
            self.refuse(name)
        if attitudes.quality.trials == self._trials:
            return events
        self._trials = attitudes.quality.trials
        return events + self._move_stamps(self._stamps.on_scatter(attitudes.quality.stamp_scatter_s))

    def _on_position(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        position = decoding.position(fields)
        if isinstance(position, Implausible):
            return self.refuse("GLOBAL_POSITION_INT")
        boot_ns = BootNs(self.stamp_ns + HALF_MS_NS - self._position_delay_ns)
        was_local, here = self._world.local, self._kept.place_at(boot_ns) if self._world.local else None
        events: tuple[TelemetryEvent, ...] = self._world.on_position(position, here)
        if was_local and not self._world.local:
            events += self._leave_local(boot_ns, events, here)
        (v_north, v_east, v_down), height_m = position.velocity_ned, position.height_above_home_m
        climb_m_s = self._climbs.climb_at(boot_ns, height_m, -v_down)
        velocity_ned = (v_north, v_east, -climb_m_s)
        self._kept.heights[HeightSource.GLOBAL_POSITION_INT].insert(boot_ns, (height_m,), (climb_m_s,))
        if self._world.plane is not None and position.place is not None:
            place_ned = self._world.plane.ned_from_geodetic(position.place)
            return events + self._take_place(boot_ns, place_ned, velocity_ned)
        return events

    def _leave_local(
        self, boot_ns: BootNs, events: tuple[TelemetryEvent, ...], here: Vector3 | None
    ) -> tuple[TelemetryEvent, ...]:
        """Go over from local to global positions. ``here``: the vehicle's place by the local ones at this instant."""
        drift_m, plane = self._kept.end_local(), self._world.plane
        if here is None or plane is None:
            self._kept.positions.clear()  # in a frame that ended
            self._jumps = PositionJumps()
            return ()
        found = any(isinstance(event, OriginSet) for event in events)
        return (
            PositionSource(
                boot_ns,
                local=False,
                origin=plane.origin,
                transfer_sigma_m=self._kept.receiver_sigma_m if found else 0.0,
                jump_sigma_m=0.0 if found else drift_m,
            ),
        )

    def _take_place(
        self, boot_ns: BootNs, place_ned: Vector3, velocity_ned: Vector3, *, is_reset: bool = False
    ) -> tuple[TelemetryEvent, ...]:
        """Store a position in the world's frame; an event where it jumped."""
        self._kept.positions.insert(boot_ns, place_ned, velocity_ned)
        jump = self._jumps.on_position(boot_ns, place_ned, velocity_ned, is_reset=is_reset)
        if jump is None:
            return ()
        self._kept.split_at_jump(boot_ns)
        return (PositionJumped(boot_ns, *jump),)

    def _on_local_position(self, fields: Any, now: HostNs) -> tuple[TelemetryEvent, ...]:
        moving = decoding.local_position((fields.x, fields.y, fields.z), (fields.vx, fields.vy, fields.vz))
        if isinstance(moving, Implausible):
            return self.refuse("LOCAL_POSITION_NED")
        self._odometry.on_local_position(now)
        return self._take_local(BootNs(self.stamp_ns + HALF_MS_NS), *moving, now)

    def _on_odometry(self, fields: Any, now: HostNs) -> tuple[TelemetryEvent, ...]:
        read = self._odometry.read(fields, now)
        if isinstance(read, OdometryPosition):
            return self._take_local(read.boot_ns, read.place, read.velocity_ned, now, is_reset=read.is_reset)
        return () if read is None else self.refuse(read.value)

    def _take_local(
        self, stamp_ns: BootNs, place: Vector3, velocity: Vector3, now: HostNs, *, is_reset: bool = False
    ) -> tuple[TelemetryEvent, ...]:
        """Store a place in the autopilot's local frame. ``is_reset``: the filter was reset since the one before."""
        boot_ns = BootNs(stamp_ns - self._position_delay_ns)
        self._kept.local.insert(boot_ns, place, velocity)
        events: tuple[TelemetryEvent, ...] = ()
        if self._world.plane is None:
            height_m, _ = self._kept.height_at(boot_ns)
            events = self._world.on_local_position(place[2] + (height_m or 0.0), now)
        elif self._world.is_global_lost(now):
            zero_ned = self._kept.local_zero_at(boot_ns)
            if zero_ned is not None:
                self._world.go_local(zero_ned)
                self._kept.begin_local()
                events = (PositionSource(boot_ns, local=True, origin=self._world.plane.origin),)
        if not self._world.local:
            return events
        in_world = add(place, self._world.local_zero_ned)
        self._kept.on_local_place(in_world)
        return events + self._take_place(boot_ns, in_world, velocity, is_reset=is_reset)

    def _on_distance(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        sample = decoding.range_sample(fields, BootNs(self.stamp_ns + HALF_MS_NS))
        if isinstance(sample, Implausible):
            return self.refuse("DISTANCE_SENSOR")
        self._kept.ranges.insert(sample.boot_ns, sample)
        return ()

    def _on_system_time(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        """Take UTC. A time that jumps against the autopilot's clock is counted, and taken once the next one agrees."""
        unix_ns = decoding.unix_ns(fields)
        if unix_ns is None:
            return ()
        sample = (unix_ns, BootNs(self.stamp_ns + HALF_MS_NS))
        if self.utc is not None and not any(decoding.utc_agrees(sample, each) for each in (self.utc, self._jumped_utc)):
            self._jumped_utc = sample
            return self.refuse("SYSTEM_TIME")
        self.utc, self._jumped_utc = sample, None
        return ()

    def _on_altitude(self, fields: Any, now: HostNs) -> tuple[TelemetryEvent, ...]:
        self._take_barometer("ALTITUDE", fields.altitude_monotonic, 0.0, now)
        return self._take_height(HeightSource.ALTITUDE, fields.altitude_relative, 0.0, now)

    def _on_vfr_hud(self, fields: Any, now: HostNs) -> tuple[TelemetryEvent, ...]:
        home_m = self._world.home_alt_amsl_m
        if home_m is None:
            self._take_barometer("VFR_HUD", fields.alt, fields.climb, now)
            return ()
        return self._take_height(HeightSource.VFR_HUD, fields.alt - home_m, fields.climb, now)

    def _on_pressure(self, fields: Any, now: HostNs) -> tuple[TelemetryEvent, ...]:
        altitude_m = altitude_of_pressure_m(fields.press_abs)
        if altitude_m is None:
            return self.refuse("SCALED_PRESSURE")
        self._take_barometer("SCALED_PRESSURE", altitude_m, 0.0, now)
        return ()

    def _take_barometer(self, source: str, altitude_m: float, climb: float, now: HostNs) -> None:
        """Store the height that a barometric altitude shows, where it is used."""
        boot_ns = self._clock.boot_from_host(now)
        if isinstance(boot_ns, Unpaired) or decoding.finite_height_m(altitude_m) is None:
            return
        height_m = self._kept.barometer.height_m(source, float(altitude_m), boot_ns)
        if height_m is not None:
            self._take_height(HeightSource.BAROMETER, height_m, climb, now)

    def _take_height(
        self, source: HeightSource, height_m: float, climb: float, now: HostNs
    ) -> tuple[TelemetryEvent, ...]:
        height = decoding.finite_height_m(height_m)
        if height is None:
            return self.refuse(source.value)
        rate = float(climb) if abs(climb) <= decoding.MOST_SPEED_M_S else 0.0
        boot_ns = self._clock.boot_from_host(now)
        if not isinstance(boot_ns, Unpaired):
            self._kept.heights[source].insert(boot_ns, (height,), (rate,))
        return ()

    def _on_gps_raw(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        self._world.on_gps_fix(fields.fix_type)
        if self._kept.position_bias is not None:
            self._kept.position_bias.on_gps(fields)
        undulation_m = decoding.undulation_m(fields)
        if undulation_m is not None:
            self.undulation_m = undulation_m
        return ()

    def _on_ardupilot_filter(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        self._world.filter_status.on_ardupilot_filter(fields)
        if self._kept.position_bias is not None:
            self._kept.position_bias.on_ardupilot_filter(fields)
        return ()

    def _on_px4_filter(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        self._world.filter_status.on_px4_filter(fields)
        if self._kept.position_bias is not None:
            self._kept.position_bias.on_px4_filter(fields)
        return ()

    def _on_extended_state(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        self._world.filter_status.on_landed_state(fields.landed_state)
        return ()

    def _on_global_origin(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        place = decoding.geodetic(fields.latitude, fields.longitude, fields.altitude)
        if place is None:
            return self.refuse("GPS_GLOBAL_ORIGIN")
        self._world.on_global_origin(place)
        return ()

    def _on_home(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        place: Geodetic | None = decoding.geodetic(fields.latitude, fields.longitude, fields.altitude)
        if place is None:
            return self.refuse("HOME_POSITION")
        events = self._world.on_home(place)
        return self.refuse("HOME_POSITION") if events is None else events

    def _on_terrain(self, fields: Any, now: HostNs) -> tuple[TelemetryEvent, ...]:
        height = decoding.finite_height_m(fields.current_height)
        boot_ns = self._clock.boot_from_host(now)
        if height is None or fields.spacing == 0 or isinstance(boot_ns, Unpaired):  # spacing 0: no terrain data there
            return self.refuse("TERRAIN_REPORT")
        self._kept.terrain.insert(boot_ns, height)
        return ()

    def _on_heartbeat(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        armed = bool(fields.base_mode & SAFETY_ARMED)
        self._trim.on_heartbeat(fields.type)
        self._kept.barometer.on_heartbeat(armed=armed)
        found = self._world.on_heartbeat(armed=armed)
        return found + self._move_stamps(self._stamps.on_heartbeat(fields.autopilot, fields.type))

    def _on_param_value(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        self._trim.on_parameter(fields.param_id, fields.param_value)
        return self._move_stamps(self._stamps.on_parameter(fields.param_id, fields.param_value))

    def _on_statustext(self, fields: Any, _now: HostNs) -> tuple[TelemetryEvent, ...]:
        return self._move_stamps(self._stamps.on_text(fields.text))

    def _put_trim_back(self) -> tuple[TelemetryEvent, ...]:
        """Apply a change of ATTITUDE's trim. Stored attitudes lack the change, and are deleted."""
        if self.choice.source != EULER:
            return ()
        self.trim_undone_deg = self._trim.correction_deg
        self._kept.attitudes.clear()
        return (PitchTrimUndone(self.trim_undone_deg),)

    def _move_stamps(self, moved_ns: int) -> tuple[TelemetryEvent, ...]:
        if moved_ns == 0:
            return ()
        self._kept.attitudes.shift(moved_ns)
        return (StampDelay(self._stamps.delay_s, self._stamps.in_step),)
