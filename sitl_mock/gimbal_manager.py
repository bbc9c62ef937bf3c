"""An autopilot's gimbal manager and its region of interest, by their specification and the autopilots' ways.

ArduPilot stores who controls the gimbal, and lets anybody command it; PX4 ignores all but the primary. The id -2 is
"me": the sender to ArduPilot, the autopilot itself to PX4. Angles and rates together are dropped silently.
"""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, hypot, isfinite, pi, radians
from typing import Any

from sitl_mock.agenda import Agenda
from sitl_mock.belief import Belief
from sitl_mock.codec import Heard
from sitl_mock.earth import Place
from sitl_mock.gimbal import BEHIND_AUTOPILOT
from sitl_mock.options import Options
from sitl_mock.radio import Radio

ACCEPTED, DENIED, FAILED = 0, 2, 4
ROI_LOCATION, ROI_NONE, PITCHYAW, CONFIGURE = 195, 197, 1000, 1001
INFORMATION, STATUS = 280, 281
NEUTRAL, ROLL_AND_PITCH_LOCK, YAW_LOCK = 2, 12, 16
HAS_PITCH_AND_YAW = 32 | 128 | 256 | 512 | 1024
ME, UNCHANGED, NOT_ME = -2, -1, -3
PITCH_LIMITS, YAW_LIMITS = (radians(-90.0), radians(30.0)), (-pi, pi)
STATUS_EVERY_NS = 2_000_000_000
STICK_DEG = 15.0
OTHER_STATION = (252, 190)


class GimbalManager:
    """Control of the gimbal, and what points it."""

    def __init__(
        self, options: Options, belief: Belief, flight_s: Callable[[int], float], agenda: Agenda, radio: Radio
    ) -> None:
        self._o, self._a, self._belief = options.gimbal, options.autopilot, belief
        self._flight_s, self._agenda, self._radio = flight_s, agenda, radio
        self.primary = (0, 0)
        self.roi: list[tuple[float, Place] | None] = []
        """Every region of interest, altitude above mean sea level; None: it was cleared."""
        self.dropped = 0
        """Commands that were not obeyed."""
        self.commands: list[tuple[float, float, float]] = []
        """(flight time, pitch, yaw) of each command that was obeyed, radians."""
        self._stick_moved = self._is_neutral = False

    def start(self, at_ns: int) -> None:
        """Begins to send the status."""
        self._agenda.at(at_ns, self._say_status)
        acts = ((self._o.taken_at_s, self._be_taken), (self._o.stick_at_s, self._move_by_stick))
        for seconds, act in (*acts, (self._o.neutral_at_s, self._go_neutral)):
            if seconds:
                self._agenda.at(at_ns + round(seconds * 1e9), act)

    def handlers(self) -> dict[int, Callable[[Heard, int], int]]:
        """Handler of each command, which returns its result."""
        table = {CONFIGURE: self._configure, PITCHYAW: self._pitchyaw}
        return {**table, ROI_LOCATION: self._roi_location, ROI_NONE: self._roi_none}

    def request(self, message_id: int, now_ns: int) -> bool:
        """Sends a requested message; returns whether it has it."""
        if message_id == STATUS:
            self._status(now_ns)
        elif message_id == INFORMATION:
            self._radio.say("GIMBAL_MANAGER_INFORMATION", self._information(now_ns), now_ns)
        return message_id in {STATUS, INFORMATION}

    def set_pitchyaw(self, heard: Heard, now_ns: int) -> None:
        """Handles GIMBAL_MANAGER_SET_PITCHYAW."""
        f = heard.fields
        angles, rates = (f["pitch"], f["yaw"]), (f["pitch_rate"], f["yaw_rate"])
        if all(map(isfinite, (*angles, *rates))) or not self._may(heard) or not all(map(isfinite, angles)):
            self.dropped += 1
            return
        self._point(angles[0], angles[1], int(f["flags"]), now_ns)

    def _may(self, heard: Heard) -> bool:
        return self._a.firmware != "px4" or (heard.system, heard.component) == self.primary

    def _point(self, pitch: float, yaw: float, flags: int, now_ns: int) -> None:
        if self._stick_moved:
            return
        t, self._is_neutral = self._flight_s(now_ns), False
        if flags & YAW_LOCK:
            yaw -= self._belief.gimbal.own_heading(t)
        pitch = max(PITCH_LIMITS[0], min(PITCH_LIMITS[1], pitch))
        self.commands.append((t, pitch, yaw))
        self._belief.gimbal.command((pitch, yaw), t)

    def _configure(self, heard: Heard, now_ns: int) -> int:
        before = self.primary
        told = (int(heard.fields["param1"]), int(heard.fields["param2"]))
        if self._o.manager_denies:
            return DENIED
        own = (self._a.system_id, self._a.component_id)
        sender = (heard.system, heard.component)
        if told == (ME, ME):
            self.primary = own if self._a.firmware == "px4" else sender
        elif told == (NOT_ME, NOT_ME):
            self.primary = (0, 0) if self.primary == sender else self.primary
        elif UNCHANGED not in told:
            self.primary = told
        if self.primary != before:
            self._status(now_ns)
        return ACCEPTED

    def _pitchyaw(self, heard: Heard, now_ns: int) -> int:
        if not self._may(heard):
            self.dropped += 1
            return DENIED
        pitch, yaw = heard.fields["param1"], heard.fields["param2"]
        if isfinite(pitch) and isfinite(yaw):
            self._point(radians(pitch), radians(yaw), int(heard.fields["param5"]), now_ns)
        return ACCEPTED

    def _roi_location(self, heard: Heard, now_ns: int) -> int:
        f, t = heard.fields, self._flight_s(now_ns)
        if heard.name != "COMMAND_INT" or self._a.refuses_roi:
            return FAILED
        place = Place(f["x"] * 1e-7, f["y"] * 1e-7, f["z"])
        self.roi.append((t, place))
        if self._o.device_id:
            own, _ = self._belief.position(t)
            north, east, down = (a - b for a, b in zip(self._ned(place), self._ned(own), strict=True))
            heading = self._belief.attitude(t)[0][2]
            self._point(-atan2(down, hypot(north, east)), atan2(east, north) - heading, 0, now_ns)
        return ACCEPTED

    def _ned(self, place: Place) -> tuple[float, float, float]:
        return self._belief.world.ned(place)

    def _roi_none(self, _heard: Heard, _now_ns: int) -> int:
        self.roi.append(None)
        return ACCEPTED

    def _be_taken(self, now_ns: int) -> None:
        self.primary = OTHER_STATION
        self._status(now_ns)

    def _move_by_stick(self, now_ns: int) -> None:
        """The pilot turns the gimbal aside; the autopilot follows the stick from now on, and no message says so."""
        t = self._flight_s(now_ns)
        pitch, yaw = self._belief.gimbal.look(t)
        self._belief.gimbal.command((pitch, yaw + radians(STICK_DEG)), t)
        self._stick_moved = True

    def _go_neutral(self, now_ns: int) -> None:
        """The pilot sends the gimbal ahead; the next command would move it again, as ArduPilot's would."""
        self._belief.gimbal.command((0.0, 0.0), self._flight_s(now_ns))
        self._is_neutral = True
        self._status(now_ns)

    def _say_status(self, at_ns: int) -> None:
        self._status(at_ns)
        self._agenda.at(at_ns + STATUS_EVERY_NS, self._say_status)

    def _status(self, now_ns: int) -> None:
        fields = {
            "time_boot_ms": self._boot_ms(now_ns),
            "flags": ROLL_AND_PITCH_LOCK | (NEUTRAL if self._is_neutral else 0),
            "gimbal_device_id": self._device,
            "primary_control_sysid": self.primary[0],
            "primary_control_compid": self.primary[1],
            "secondary_control_sysid": 0,
            "secondary_control_compid": 0,
        }
        self._radio.say("GIMBAL_MANAGER_STATUS", fields, now_ns)

    def _information(self, now_ns: int) -> dict[str, Any]:
        limits = {"pitch_min": PITCH_LIMITS[0], "pitch_max": PITCH_LIMITS[1], "yaw_min": YAW_LIMITS[0]}
        return {
            "time_boot_ms": self._boot_ms(now_ns),
            "cap_flags": HAS_PITCH_AND_YAW,
            "gimbal_device_id": self._device,
            "roll_min": 0.0,
            "roll_max": 0.0,
            **limits,
            "yaw_max": YAW_LIMITS[1],
        }

    @property
    def _device(self) -> int:
        return self._o.device_id if self._o.device_id > BEHIND_AUTOPILOT else max(self._o.device_id, 1)

    def _boot_ms(self, now_ns: int) -> int:
        return round(self._flight_s(now_ns) * 1e3) + round(self._a.boot_at_start_s * 1e3)
