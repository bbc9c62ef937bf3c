"""Events of telemetry: changes that happen once, in contrast to samples."""

from __future__ import annotations

from typing import TypeAlias

import msgspec

from fwav_companion.geometry.earth import Geodetic
from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.telemetry.clock.clock_news import ClockRate, ClockSlipped


class Rebooted(msgspec.Struct, frozen=True):
    """The autopilot's clock started again. Clock estimate and attitudes are deleted; a global origin stays."""

    at_ns: HostNs
    frame_ended: bool = False
    """Whether the world was the autopilot's local frame, which ended with it; then its tracks must be dropped."""


class OriginSet(msgspec.Struct, frozen=True):
    """The world has an origin, which never moves."""

    origin: Geodetic
    late: bool
    """Whether the world was relative or local until now; then its tracks must be dropped."""


class RelativeWorld(msgspec.Struct, frozen=True):
    """There is no global position: from now on targets are relative to the point below the camera."""


class LocalWorld(msgspec.Struct, frozen=True):
    """There is no global position, and the autopilot vouches for its local one: from now on the world is its local
    frame.
    """

    late: bool
    """Whether the world was relative until now; then its tracks must be dropped."""
    home_down_m: float
    """Home surface, metres below the origin."""


class PositionSource(msgspec.Struct, frozen=True):
    """The vehicle's positions come from the other of global and local from now on. NED's zero stays where it is."""

    boot_ns: BootNs
    """Instant of the first position of the new source."""
    local: bool
    """Whether they are the autopilot's local ones from now on."""
    origin: Geodetic
    """Place of NED's zero on the earth."""
    transfer_sigma_m: float = 0.0
    """One sigma of that place where the new source has just shown it, metres an axis: every target has it too."""
    jump_sigma_m: float = 0.0
    """One sigma of the step from the former positions to the new ones, metres an axis."""


class TakeOffFound(msgspec.Struct, frozen=True):
    """The take-off place became known, or better known, after the origin was set: from HOME_POSITION, from arming, or
    because the vehicle is at rest.
    """

    place: Geodetic


class HomeMoved(msgspec.Struct, frozen=True):
    """The autopilot's home, and with it the ``home`` ground surface, moved to another height."""

    down_m: float
    """Home surface, metres below the origin."""


class AttitudeSource(msgspec.Struct, frozen=True):
    """Another message became the source of attitudes; attitudes of the old source are deleted.

    The two may differ by a constant (ArduPlane's pitch trim); an interpolation through both would have a step.
    """

    message: str
    """ATTITUDE or ATTITUDE_QUATERNION."""
    before: str
    """Source until now: ATTITUDE or ATTITUDE_QUATERNION."""


class StampDelay(msgspec.Struct, frozen=True):
    """A new delay of attitude stamps, from the autopilot's messages or from its attitudes; stored attitudes were moved
    accordingly.
    """

    delay_s: float
    """Largest delay, seconds; its mean, half of it, is corrected."""
    in_step: bool = False
    """Attitude timestamps are synchronous with sampling: no delay is corrected unless one is configured."""


class GimbalUnused(msgspec.Struct, frozen=True):
    """A gimbal reports its attitude, and [camera.mount] gimbal_device_id is 0: the camera counts as fixed."""

    device_id: int
    """The gimbal_device_id with which it would be used."""


class GimbalHeadingDiffers(msgspec.Struct, frozen=True):
    """The gimbal's idea of the vehicle's heading is not the autopilot's, which is used."""

    deg: float
    """Gimbal's less the autopilot's, degrees."""


class PitchTrimUndone(msgspec.Struct, frozen=True):
    """The pitch trim that ATTITUDE lacks is added from now on; attitudes without it are deleted."""

    deg: float
    """Trim, degrees; 0: no trim is added any more."""


class PositionJumped(msgspec.Struct, frozen=True):
    """The autopilot's position jumped beyond its velocity: its filter was reset."""

    boot_ns: BootNs
    """Instant of the first position after the jump."""
    north_m: float
    east_m: float


class ClockContradicted(msgspec.Struct, frozen=True):
    """The arrivals of messages have begun to contradict the clock estimate: exchanges should decide."""


TelemetryEvent: TypeAlias = (
    Rebooted
    | ClockContradicted
    | ClockSlipped
    | ClockRate
    | OriginSet
    | RelativeWorld
    | LocalWorld
    | PositionSource
    | TakeOffFound
    | HomeMoved
    | AttitudeSource
    | StampDelay
    | GimbalUnused
    | GimbalHeadingDiffers
    | PitchTrimUndone
    | PositionJumped
)
