"""Decodes MAVLink messages to the state of vehicles. Pure.

Fields are collected as they arrive, and written to the picture once a tick, so that fifty vehicles at 50 Hz cost
little.
"""

from __future__ import annotations

from collections.abc import Callable
from math import atan, degrees, hypot, isfinite, pi
from typing import Any

from fwav_companion.geometry.earth import Geodetic
from fwav_companion.geometry.rotations import Quaternion, euler_from_quaternion, quaternion_from_euler
from fwav_companion.ground.evidence import SILENT_S
from fwav_companion.ground.footprint import corner_rays, footprint
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.mavlink.wire.enums import (
    MAV_AUTOPILOT_ARDUPILOTMEGA,
    MAV_AUTOPILOT_INVALID,
    MAV_AUTOPILOT_PX4,
    MAV_MODE_FLAG_SAFETY_ARMED,
    MAV_STATE_CRITICAL,
    MAV_TYPE_ONBOARD_CONTROLLER,
)
from fwav_companion.types import Message

FOOTPRINT_STEP_S = 0.2
FIRMWARE = {MAV_AUTOPILOT_ARDUPILOTMEGA: "ArduPilot", MAV_AUTOPILOT_PX4: "PX4"}
TYPES = {1: "plane", 2: "copter", 10: "rover", 11: "boat", 13: "copter", 14: "copter", 16: "flapping wing", 20: "VTOL"}
"""MAV_TYPE in words, for the types in use here."""
GPS_FIXES = ("no GPS", "no fix", "2D", "3D", "DGPS", "RTK float", "RTK fixed", "static", "PPP")
"""GPS_FIX_TYPE in words."""
UNKNOWN_U16 = 0xFFFF


class VehicleMemory:
    """Data received from one vehicle that are not yet in the picture."""

    def __init__(self) -> None:
        self.changes: dict[str, Any] = {}
        self.heard: dict[str, float] = {}
        """Instants of what was received, by part and value, that are not written yet."""
        self.known = False
        """Whether a heartbeat of an autopilot was received."""
        self.place: Geodetic | None = None
        self.placed_unix = 0.0
        self.height_m: float | None = None
        self.attitude: Quaternion | None = None
        self.field_of_view_deg: tuple[float, float] | None = None
        self.footprint_unix = 0.0
        self.undulation_m: float | None = None
        """Height of the geoid above the ellipsoid by the vehicle's receiver."""
        self.components: set[int] = set()


class VehicleMessages:
    """Decodes messages about vehicles."""

    def __init__(self, picture: GroundPicture, hfov_deg: float | None = None) -> None:
        """``hfov_deg``: horizontal field of view of cameras that do not report theirs; they look down."""
        self._picture = picture
        self._hfov_deg = hfov_deg
        self._memories: dict[int, VehicleMemory] = {}
        """By system id, at most 256: a smaller bound would let invented systems keep a new vehicle out."""
        self._handlers: dict[str, Callable[[VehicleMemory, Message, float], None]] = {
            "HEARTBEAT": self._on_heartbeat,
            "GLOBAL_POSITION_INT": self._on_position,
            "ATTITUDE": self._on_attitude,
            "ATTITUDE_QUATERNION": self._on_quaternion,
            "SYS_STATUS": self._on_battery,
            "GPS_RAW_INT": self._on_gps,
            "CAMERA_INFORMATION": self._on_camera,
            "VIDEO_STREAM_INFORMATION": self._on_video,
            "CAMERA_FOV_STATUS": self._on_field_of_view,
        }

    def on_message(self, message: Message, now: float) -> None:
        """Process one message of any sender."""
        handler = self._handlers.get(message.name)
        if handler is None:
            return
        memory = self._memories.get(message.system)
        if memory is None:
            if message.name != "HEARTBEAT":
                return
            memory = self._memories[message.system] = VehicleMemory()
        handler(memory, message, now)

    def flush(self, now: float) -> None:
        """Write the fields received since the last call to the picture."""
        for system, memory in self._memories.items():
            if not memory.known or not (memory.changes or memory.heard):
                continue
            self._add_footprint(memory, now)
            changes, memory.changes = memory.changes, {}
            heard, memory.heard = memory.heard, {}
            self._picture.on_vehicle(str(system), now, heard=heard, **changes)

    def knows(self, system: int) -> bool:
        """Whether an autopilot of this system was heard."""
        memory = self._memories.get(system)
        return memory is not None and memory.known

    def undulation_m(self, system: int) -> float | None:
        """Height of the geoid above the ellipsoid at this vehicle, metres."""
        memory = self._memories.get(system)
        return None if memory is None else memory.undulation_m

    def _on_heartbeat(self, memory: VehicleMemory, message: Message, now: float) -> None:
        fields = message.fields
        if fields.autopilot != MAV_AUTOPILOT_INVALID:
            memory.known, memory.heard["autopilot"] = True, now
            firmware = FIRMWARE.get(fields.autopilot, "autopilot")
            memory.changes["kind"] = f"{firmware} {TYPES.get(fields.type, 'vehicle')}"
            memory.changes["armed"] = bool(fields.base_mode & MAV_MODE_FLAG_SAFETY_ARMED)
        elif fields.type == MAV_TYPE_ONBOARD_CONTROLLER:
            memory.heard["companion"] = now
            critical = fields.system_status >= MAV_STATE_CRITICAL
            memory.changes["companion"] = "trouble" if critical else "healthy"

    def _on_position(self, memory: VehicleMemory, message: Message, now: float) -> None:
        fields = message.fields
        if fields.lat == 0 and fields.lon == 0:  # MAVLink's "no position yet"
            return
        lat, lon, alt_amsl = fields.lat / 1e7, fields.lon / 1e7, fields.alt / 1e3
        memory.place, memory.height_m = Geodetic.from_degrees(lat, lon, alt_amsl), fields.relative_alt / 1e3
        memory.changes |= {"lat": lat, "lon": lon, "alt_amsl": alt_amsl, "height_m": memory.height_m}
        memory.changes["speed_m_s"] = hypot(fields.vx, fields.vy) / 100.0
        memory.heard["position"] = memory.placed_unix = now
        if fields.hdg != UNKNOWN_U16:
            memory.changes["heading_deg"] = fields.hdg / 100.0

    def _on_attitude(self, memory: VehicleMemory, message: Message, now: float) -> None:
        fields = message.fields
        self._take_attitude(memory, (fields.roll, fields.pitch, fields.yaw), now)

    def _on_quaternion(self, memory: VehicleMemory, message: Message, now: float) -> None:
        fields = message.fields
        q = (fields.q1, fields.q2, fields.q3, fields.q4)
        if all(map(isfinite, q)) and any(q):
            self._take_attitude(memory, euler_from_quaternion(q), now)

    def _take_attitude(self, memory: VehicleMemory, euler: tuple[float, float, float], now: float) -> None:
        if not all(map(isfinite, euler)):
            return
        roll, pitch, yaw = euler
        memory.attitude = quaternion_from_euler(roll, pitch, yaw)
        memory.changes |= {"roll_deg": degrees(roll), "pitch_deg": degrees(pitch)}
        memory.changes["heading_deg"] = degrees(yaw % (2.0 * pi))
        memory.heard["attitude"] = now

    def _on_battery(self, memory: VehicleMemory, message: Message, now: float) -> None:
        fields = message.fields
        memory.heard["battery"] = now
        known = fields.voltage_battery not in (0, UNKNOWN_U16)
        memory.changes["battery_v"] = fields.voltage_battery / 1e3 if known else None
        memory.changes["battery_percent"] = fields.battery_remaining if fields.battery_remaining >= 0 else None

    def _on_gps(self, memory: VehicleMemory, message: Message, now: float) -> None:
        fields = message.fields
        memory.heard["gps"] = now
        kind = GPS_FIXES[fields.fix_type] if fields.fix_type < len(GPS_FIXES) else "unknown"
        seen = "" if fields.satellites_visible == 255 else f", {fields.satellites_visible} satellites"
        memory.changes["gps"] = kind + seen
        if fields.alt_ellipsoid:
            memory.undulation_m = (fields.alt_ellipsoid - fields.alt) / 1e3

    def _on_camera(self, memory: VehicleMemory, message: Message, _now: float) -> None:
        fields = message.fields
        size = (fields.sensor_size_h, fields.sensor_size_v)
        if fields.focal_length > 0.0 and min(size) > 0.0:  # false for NaN
            right, down = (2.0 * degrees(atan(each / (2.0 * fields.focal_length))) for each in size)
            memory.field_of_view_deg = (right, down)
        elif self._hfov_deg is not None and fields.resolution_h and memory.field_of_view_deg is None:
            memory.field_of_view_deg = (self._hfov_deg, self._hfov_deg * fields.resolution_v / fields.resolution_h)

    def _on_video(self, memory: VehicleMemory, message: Message, _now: float) -> None:
        fields = message.fields
        if fields.hfov and fields.resolution_h:
            memory.field_of_view_deg = (fields.hfov, fields.hfov * fields.resolution_v / fields.resolution_h)

    def _on_field_of_view(self, memory: VehicleMemory, message: Message, _now: float) -> None:
        fields = message.fields
        if fields.hfov > 0.0 and fields.vfov > 0.0:
            memory.field_of_view_deg = (fields.hfov, fields.vfov)

    def _add_footprint(self, memory: VehicleMemory, now: float) -> None:
        """Add the camera's footprint, at most five times a second."""
        if memory.place is None or memory.height_m is None or memory.attitude is None:
            return
        if now > memory.placed_unix + SILENT_S:  # the view of a place where it may no longer be
            memory.changes["footprint"] = ()
            return
        view = memory.field_of_view_deg or (None if self._hfov_deg is None else (self._hfov_deg, 0.75 * self._hfov_deg))
        if view is None or now < memory.footprint_unix + FOOTPRINT_STEP_S:
            return
        memory.footprint_unix = now
        memory.changes["footprint"] = footprint(memory.place, memory.height_m, memory.attitude, corner_rays(*view))
