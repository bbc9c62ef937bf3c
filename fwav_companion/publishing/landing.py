"""LANDING_TARGET (149), which steers a landing: in the form that the autopilot needs, or withheld for a named reason.

Pure. ArduPilot takes a vector in the vehicle's body axes, and rotates it to the world by the attitude of ``PLND_LAG``
before the message's arrival. Therefore the vector is given in the body axes of that instant, not of the capture. PX4
takes a point in its own local frame, which differs from the service's: the target relative to the vehicle at the
capture is added to PX4's own position at the capture. LOCAL_FRD is never sent: ArduPilot shipped it with the wrong sign
of yaw.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from enum import StrEnum
from math import atan2, hypot
from typing import Any, TypeAlias

from msgspec import structs

from fwav_companion.geometry.rotations import conjugate, exp, multiply, rotate
from fwav_companion.geometry.stamps import NS_PER_US, BootNs, HostNs, ns_from_s, s_from_ns
from fwav_companion.geometry.vectors import Vector3, add, norm, scale, subtract, transform
from fwav_companion.publishing import enums
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.selection import seniority, successor
from fwav_companion.publishing.target_report import larger_sigma
from fwav_companion.types.messages import Destination, Outgoing
from fwav_companion.types.sightings import GroundFix, Unpaired
from fwav_companion.types.situation import AutopilotKind, Situation
from fwav_companion.types.telemetry import VehicleState
from fwav_companion.types.tracks import Track, TrackState

StateAt: TypeAlias = Callable[[BootNs], VehicleState | Unpaired]
"""Vehicle state at an instant of the autopilot's clock, or the reason why it is not known."""

DEFAULT_LAG_S = 0.02
"""Default of ArduPilot's PLND_LAG, seconds."""
LEAST_LAG_S, MOST_LAG_S = 0.02, 0.25
"""Limits that ArduPilot sets to PLND_LAG (AC_PrecLand::init), seconds."""
MAX_BRIDGED_S = 0.1
"""Longest extrapolation of an attitude by its rates, seconds: half a beat at 5 Hz. Beyond it the extrapolation does not
hold for a flapping body."""
LEAST_SIDEWAYS = 1e-6
"""Horizontal part of a unit ray below which it is only rounding."""
MAX_AGE_S = 0.5
"""Greatest age of a frame that steers a landing, seconds."""


class Withheld(StrEnum):
    """Reasons why a frame gave no LANDING_TARGET."""

    NO_TARGET = "no_target"
    """No confirmed track of landing_label."""
    NOT_CONFIRMED = "not_confirmed"
    """The target is coasting: predicted, not seen."""
    NO_FIX = "no_fix"
    """This frame gave the target no fix."""
    TOO_UNCERTAIN = "too_uncertain"
    """The larger semi-axis relative to the vehicle is beyond landing_max_sigma_m, or NaN."""
    LATE_FRAME = "late_frame"
    """A newer frame has been sent, or this one is older than 0.5 s."""
    NO_AUTOPILOT = "no_autopilot"
    UNKNOWN_AUTOPILOT = "unknown_autopilot"
    """The autopilot is neither ArduPilot nor PX4: its interpretation of the message is unknown."""
    NO_VEHICLE = "no_vehicle"
    """The vehicle's state at the instant that the message needs is unknown."""
    NO_LOCAL_POSITION = "no_local_position"
    """PX4's own LOCAL_POSITION_NED at the capture is unknown."""
    CLOCK_IN_DOUBT = "clock_in_doubt"
    """The autopilot's clock slips or changes its rate: the capture on that clock is too uncertain."""
    NO_HEIGHT = "no_height"
    """There is no global position, and the camera's height above the target is unknown."""


class Landing:
    """Chooses the target to land on and keeps it until its track is dropped; clicks do not change it."""

    def __init__(self, options: PublishOptions, state_at: StateAt | None = None):
        self._options = options
        self._state_at = state_at
        self._target: int | None = None
        self._last_sent_ns: HostNs | None = None
        self.lag_s = DEFAULT_LAG_S
        """The autopilot's PLND_LAG, seconds; the default before it is known."""
        self.sent = 0
        self.withheld: dict[Withheld, int] = dict.fromkeys(Withheld, 0)
        self.last_withheld: Withheld | None = None
        """Reason of the newest frame; None where its message was sent."""

    @property
    def target(self) -> int | None:
        """Id of the track to land on."""
        return self._target

    def on_tracks(self, tracks: tuple[Track, ...], situation: Situation) -> Outgoing | None:
        """LANDING_TARGET of the frame with these tracks; None where it is withheld, and then the reason is counted."""
        if not self._options.landing_target:
            return None
        answer = self._message(tracks, situation)
        if isinstance(answer, Withheld):
            self.withheld[answer] += 1
            self.last_withheld = answer
            return None
        self.sent += 1
        self.last_withheld = None
        return answer

    def _message(self, tracks: tuple[Track, ...], situation: Situation) -> Outgoing | Withheld:
        track = self._choose(tracks)
        if track is None:
            return Withheld.NO_TARGET
        refusal = self._refusal(track, situation)
        if refusal is not None:
            return refusal
        if situation.autopilot is None:
            return Withheld.NO_AUTOPILOT
        if situation.autopilot.kind is AutopilotKind.ARDUPILOT:
            fields = self._ardupilot(track, situation)
        elif situation.autopilot.kind is AutopilotKind.PX4:
            fields = self._px4(track, situation)
        else:
            return Withheld.UNKNOWN_AUTOPILOT
        if isinstance(fields, Withheld):
            return fields
        self._last_sent_ns = track.host_ns
        return Outgoing(
            name="LANDING_TARGET",
            fields=fields,
            to=Destination.AUTOPILOT,
            component=self._options.companion_component,
        )

    def _choose(self, tracks: Iterable[Track]) -> Track | None:
        """The track to land on, or the track that it was merged into; another one only after that track was dropped."""
        live = {track.id: track for track in tracks if track.state is not TrackState.DROPPED}
        if self._target is not None and self._target not in live:
            self._target = successor(self._target, live.values())
        if self._target is None:
            confirmed = [
                track
                for track in live.values()
                if track.label == self._options.landing_label and track.state is TrackState.CONFIRMED
            ]
            oldest = min(confirmed, key=seniority, default=None)
            self._target = oldest.id if oldest is not None else None
        return live[self._target] if self._target is not None else None

    def _refusal(self, track: Track, situation: Situation) -> Withheld | None:
        if track.state is not TrackState.CONFIRMED:
            return Withheld.NOT_CONFIRMED
        if track.fix is None:
            return Withheld.NO_FIX
        if not larger_sigma(track.relative_cov) <= self._options.landing_max_sigma_m:
            return Withheld.TOO_UNCERTAIN
        clock = situation.clock
        if clock is not None and clock.doubtful:
            return Withheld.CLOCK_IN_DOUBT
        too_old = s_from_ns(situation.now_ns - track.host_ns) > MAX_AGE_S
        if too_old or (self._last_sent_ns is not None and track.host_ns <= self._last_sent_ns):
            return Withheld.LATE_FRAME
        return None

    def _ardupilot(self, track: Track, situation: Situation) -> dict[str, Any] | Withheld:
        used = self._state_when_used(situation)
        if used is None:
            return Withheld.NO_VEHICLE
        target = track.apparent_ned
        if track.velocity_ned is not None:
            age_s = s_from_ns(used.boot_ns - track.boot_ns)
            target = add(target, scale(track.velocity_ned, age_s))
        relative = self._from_vehicle(target, track, used)
        if isinstance(relative, Withheld):
            return relative
        in_body = rotate(conjugate(used.ned_from_body), relative)
        return _fields(track, enums.MAV_FRAME_BODY_FRD, in_body, in_body)

    def _px4(self, track: Track, situation: Situation) -> dict[str, Any] | Withheld:
        state = situation.at_capture
        if state is None:
            return Withheld.NO_VEHICLE
        if situation.local_position_ned is None:
            return Withheld.NO_LOCAL_POSITION
        relative = self._from_vehicle(track.apparent_ned, track, state)
        if isinstance(relative, Withheld):
            return relative
        in_body = rotate(conjugate(state.ned_from_body), relative)
        return _fields(track, enums.MAV_FRAME_LOCAL_NED, add(situation.local_position_ned, relative), in_body)

    def _state_when_used(self, situation: Situation) -> VehicleState | None:
        """Vehicle state at (arrival - PLND_LAG), from the history, else extrapolated from the newest state."""
        newest, clock = situation.vehicle, situation.clock
        if newest is None:
            return None
        if clock is None:
            return newest
        transit_s = 0.5 * clock.round_trip_s if clock.round_trip_s is not None else 0.0
        boot_now_ns = situation.now_ns - clock.host_from_autopilot_ns
        used_ns = BootNs(boot_now_ns + ns_from_s(transit_s - self.lag_s))
        step_s = s_from_ns(used_ns - newest.boot_ns)
        if not step_s <= MAX_BRIDGED_S:
            return None
        known = self._state_at(used_ns) if self._state_at is not None else None
        if isinstance(known, VehicleState):
            return known
        return _carried(newest, step_s) if step_s >= -MAX_BRIDGED_S else None

    def _from_vehicle(self, target: Vector3, track: Track, state: VehicleState) -> Vector3 | Withheld:
        """Vector from the vehicle to the target, NED, metres."""
        if state.position_ned is not None:
            return subtract(target, state.position_ned)
        height_m = _camera_height(track.fix, state) if track.fix is not None else None
        if height_m is None:
            return Withheld.NO_HEIGHT
        from_camera = (target[0], target[1], target[2] + height_m)
        return add(from_camera, rotate(state.ned_from_body, self._options.camera_position_m))


def _carried(state: VehicleState, step_s: float) -> VehicleState:
    """The state extrapolated by ``step_s``, positive or negative, with constant rates and velocity."""
    turned = multiply(state.ned_from_body, exp(scale(state.rates, step_s)))
    position = state.position_ned
    if position is not None and state.velocity_ned is not None:
        position = add(position, scale(state.velocity_ned, step_s))
    boot_ns = BootNs(state.boot_ns + ns_from_s(step_s))
    return structs.replace(state, boot_ns=boot_ns, ned_from_body=turned, position_ned=position)


def _camera_height(fix: GroundFix, state: VehicleState) -> float | None:
    """Height of the camera above the ground under the target, in a world without a global position.

    The fix is then relative to the point below the camera, so its horizontal distance and the direction of its ray give
    the height. For a ray straight down they do not; then the autopilot's height above home is used.
    """
    north, east, down = transform(fix.sighting.ned_from_camera, fix.sighting.ray.direction)
    sideways = hypot(north, east)
    if sideways > LEAST_SIDEWAYS:
        return hypot(fix.position_ned[0], fix.position_ned[1]) / sideways * down
    return state.height_above_home_m


def _fields(track: Track, frame: int, point: Vector3, in_body: Vector3) -> dict[str, Any]:
    """Fields of the message: ``point`` in ``frame``, and its direction as angles of a camera that looks down."""
    forward, right, down = in_body
    return {
        "time_usec": track.host_ns // NS_PER_US,
        "target_num": track.id % 256,
        "frame": frame,
        "angle_x": atan2(right, down),
        "angle_y": atan2(-forward, down),
        "distance": norm(in_body),
        "size_x": 0.0,
        "size_y": 0.0,
        "x": point[0],
        "y": point[1],
        "z": point[2],
        "q": (1.0, 0.0, 0.0, 0.0),
        "type": enums.LANDING_TARGET_TYPE_VISION_OTHER,
        "position_valid": 1,
    }
