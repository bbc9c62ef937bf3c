"""What telemetry tells besides samples: things that happened once."""

from __future__ import annotations

from typing import TypeAlias

import msgspec

from fwav_companion.geometry.earth import Geodetic
from fwav_companion.geometry.stamps import HostNs


class Rebooted(msgspec.Struct, frozen=True):
    """The autopilot's clock began anew. Clock and attitudes are empty; the world's origin stays."""

    at_ns: HostNs


class OriginSet(msgspec.Struct, frozen=True):
    """The world has an origin. It never moves."""

    origin: Geodetic
    late: bool
    """The world was relative until now: what was located in it must be dropped."""


class RelativeWorld(msgspec.Struct, frozen=True):
    """There is no global position: targets are relative to the point below the camera from now on."""


class TakeOffFound(msgspec.Struct, frozen=True):
    """The first HOME_POSITION came after the origin was set: the take-off place is known, no longer only assumed."""

    place: Geodetic


class HomeMoved(msgspec.Struct, frozen=True):
    """The autopilot's home, and with it the surface of ``home`` ground, lies at another height."""

    down_m: float
    """Of the home surface, metres below the origin."""


class AttitudeSource(msgspec.Struct, frozen=True):
    """Another message is the source of attitudes; those of the old one are forgotten.

    The two may differ by a constant (ArduPlane's pitch trim): a course through both would hold a step.
    """

    message: str
    """ATTITUDE or ATTITUDE_QUATERNION."""
    before: str
    """The same, of what was used until now."""


class StampDelay(msgspec.Struct, frozen=True):
    """The autopilot told, or its attitudes showed, how late these are stamped; the kept ones were moved along."""

    delay_s: float
    """The most; the mean, half of it, is what is corrected."""
    in_step: bool = False
    """The attitudes show that stamps do not scatter: they are taken at their word, unless a delay is configured."""


class PitchTrimUndone(msgspec.Struct, frozen=True):
    """The pitch trim that ATTITUDE lacks is put back from now on; attitudes taken without it are forgotten."""

    deg: float
    """0: none is put back any more."""


TelemetryEvent: TypeAlias = (
    Rebooted | OriginSet | RelativeWorld | TakeOffFound | HomeMoved | AttitudeSource | StampDelay | PitchTrimUndone
)
