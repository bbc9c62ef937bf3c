"""Texts for the pilot of a landing: the target in sight, withheld, lost, and where the vehicle landed. Pure."""

from __future__ import annotations

from enum import Enum, StrEnum, auto
from math import cos, isfinite, nan, sin
from typing import Final

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, HostNs, s_from_ns
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.types.messages import Notice, NoticeCode, Severity

WITHHELD_NS = NS_PER_S
"""Time without a message after which a text is due: ArduPilot loses its target after 2 s."""
APART_NS = 5 * NS_PER_S
"""Least time between two texts, so that a claim about the limit does not fill the pilot's screen."""
LANDED_NS = 15 * NS_PER_S
"""Longest time from the last look to the disarming of a landing on the target: the last half metre without a fix, and
what an autopilot waits on the ground."""
LANDED_HEIGHT_M = 3.0
"""Greatest height of that last look above the target: from higher a vehicle that disarms landed elsewhere."""
RADIUS_95 = 2.4477
"""Radius of the 95 % circle over one sigma of its larger semi-axis, for the widest ellipse, a circle."""
MOST_M = 100.0
"""Claim beyond which its figure says nothing, metres."""


class Withheld(StrEnum):
    """Reasons why no LANDING_TARGET was sent."""

    NO_TARGET = "no_target"
    """No track of landing_label is confirmed."""
    NOT_SEEN = "not_seen"
    """The last fix of the target is older than 1.5 s, although frames come."""
    LATE_FRAME = "late_frame"
    """The newest frame is older than 1.5 s: the camera or its detector is late."""
    NO_FRAMES = "no_frames"
    """The last fix of the target is older than 1.5 s, and no frame has come for a second."""
    TOO_UNCERTAIN = "too_uncertain"
    """The larger semi-axis relative to the vehicle is beyond landing_max_sigma_m, or not known."""
    NO_AUTOPILOT = "no_autopilot"
    """No autopilot is adopted."""
    UNKNOWN_AUTOPILOT = "unknown_autopilot"
    """The autopilot is neither ArduPilot nor PX4: its interpretation of the message is unknown."""
    NO_VEHICLE = "no_vehicle"
    """The vehicle's attitude at the instant that the message needs is not known."""
    NO_LOCAL_POSITION = "no_local_position"
    """PX4's own LOCAL_POSITION_NED at that instant is not known."""
    NO_HEIGHT = "no_height"
    """There is no global position, and the camera's height above the target is not known."""


CAUSES: Final = {
    Withheld.LATE_FRAME: "camera {:.1f} s late",
    Withheld.NOT_SEEN: "not seen for {:.1f} s",
    Withheld.NO_FRAMES: "no picture for {:.1f} s",
    Withheld.NO_VEHICLE: "attitude {:.1f} s old",
    Withheld.NO_LOCAL_POSITION: "no LOCAL_POSITION_NED",
    Withheld.NO_HEIGHT: "height unknown",
    Withheld.UNKNOWN_AUTOPILOT: "no ArduPilot, no PX4",
    Withheld.NO_AUTOPILOT: "no autopilot",
    Withheld.NO_TARGET: "no target",
}
"""Cause in the pilot's text, with the refusal's figure."""


class Refusal(msgspec.Struct, frozen=True, gc=False):
    """The reason why no message was sent, with its figure."""

    reason: Withheld
    figure: float = nan
    """An age in seconds, or one sigma in metres, by the reason; NaN without one."""


class LandingSight(msgspec.Struct, frozen=True, gc=False):
    """Where the target is in one LANDING_TARGET message, in level axes along the vehicle's heading."""

    at_ns: HostNs
    forward_m: float
    right_m: float
    down_m: float
    sigma_m: float
    """Claim of the message, metres."""

    @property
    def offset(self) -> str:
        """The horizontal offset in at most 27 characters: "0.42 m ahead, 0.03 m left"."""
        ahead = f"{_metres(abs(self.forward_m))} m {'ahead' if self.forward_m >= 0.0 else 'behind'}"
        return f"{ahead}, {_metres(abs(self.right_m))} m {'right' if self.right_m >= 0.0 else 'left'}"


def landing_sight(relative_ned: Vector3, yaw: float, sigma_m: float, at_ns: HostNs) -> LandingSight:
    """The target's place from the vehicle by its vector in NED and the vehicle's heading, radians from north."""
    north, east, down = relative_ned
    return LandingSight(at_ns, cos(yaw) * north + sin(yaw) * east, cos(yaw) * east - sin(yaw) * north, down, sigma_m)


class _Told(Enum):
    """The last text about the target."""

    NOTHING = auto()
    SEEN = auto()
    LOST = auto()
    WITHHELD = auto()


class LandingReports:
    """Decides when a text reports that the target is seen, lost or withheld, and where the vehicle landed."""

    def __init__(self, limit_m: float) -> None:
        """``limit_m``: landing_max_sigma_m."""
        self._limit_m = limit_m
        self._since_ns: HostNs | None = None
        self._told = _Told.NOTHING
        self._text_ns: HostNs | None = None
        self._seen_ns: HostNs | None = None
        """Instant of the last text that the target is seen; it keeps no text of a trouble waiting."""
        self.sight: LandingSight | None = None
        """The target in the newest message; None before the first, and after a landing."""
        self.landed: LandingSight | None = None
        """The target in the last message before the last landing; None before the first landing on it."""

    def withheld_s(self, now: HostNs) -> float | None:
        """Time for which the messages of a known target have been withheld, seconds; None where they flow."""
        return None if self._since_ns is None else s_from_ns(now - self._since_ns)

    @property
    def is_pending(self) -> bool:
        """Whether a text becomes due by the passing of time alone."""
        return self._since_ns is not None and self._told is not _Told.WITHHELD

    def on_lost(self) -> None:
        """Stop counting: there is no target, which has a notice of its own. The next one is a new sight."""
        self._since_ns = None
        if self._told is not _Told.WITHHELD:
            self._told = _Told.NOTHING

    def on_sent(self, sight: LandingSight, lost: Refusal | None, now: HostNs) -> Notice | None:
        """The notice after a message: that the target is seen or lost, or that messages flow again; None where the last
        text still holds.

        ``lost``: why the target has not been seen for a second, although its prediction is still sent.
        """
        self._since_ns, self.sight = None, sight
        if lost is not None:
            if self._told is _Told.LOST or not self._may_speak(now):
                return None
            self._told, self._text_ns = _Told.LOST, now
            text = f"pad lost: {_cause(lost, self._limit_m)}"
            return Notice(NoticeCode.LANDING_LOST, Severity.WARNING, text, to_ground=True)
        if self._told is _Told.SEEN or not self._may_speak(now):
            return None
        if self._told is _Told.WITHHELD:
            self._told, self._text_ns = _Told.SEEN, now
            text = f"LANDING_TARGET is sent: target {_metres(sight.sigma_m)} m"
            return Notice(NoticeCode.LANDING_SENT, Severity.NOTICE, text, to_ground=True)
        if self._seen_ns is not None and now - self._seen_ns < APART_NS:
            return None
        self._told, self._seen_ns = _Told.SEEN, now
        text = f"pad seen: {sight.offset}, 95 % {_metres(RADIUS_95 * sight.sigma_m)} m"
        return Notice(NoticeCode.LANDING_IN_SIGHT, Severity.NOTICE, text, to_ground=True)

    def on_withheld(self, refusal: Refusal, now: HostNs) -> Notice | None:
        """The notice after a withheld message; None before it is due, and after it was given."""
        if self._since_ns is None:
            self._since_ns = now
        if self._told is _Told.WITHHELD or now - self._since_ns <= WITHHELD_NS or not self._may_speak(now):
            return None
        self._told, self._text_ns = _Told.WITHHELD, now
        text = f"LANDING_TARGET withheld: {_cause(refusal, self._limit_m)}"
        return Notice(NoticeCode.LANDING_WITHHELD, Severity.WARNING, text, to_ground=True)

    def on_disarmed(self, now: HostNs) -> Notice | None:
        """The notice of a landing on the target: where it was in the last message; None where the vehicle disarmed too
        long after it, or too high above it, to have landed on it.
        """
        last, self.sight = self.sight, None
        if last is None or now - last.at_ns > LANDED_NS or last.down_m > LANDED_HEIGHT_M:
            return None
        self.landed = last
        text = f"landed: pad {last.offset}, {s_from_ns(now - last.at_ns):.0f} s ago"
        return Notice(NoticeCode.LANDED, Severity.NOTICE, text, to_ground=True)

    def _may_speak(self, now: HostNs) -> bool:
        return self._text_ns is None or now - self._text_ns >= APART_NS


def _cause(refusal: Refusal, limit_m: float) -> str:
    """The reason in at most 25 characters: a text of 50 is one message."""
    figure = refusal.figure
    if refusal.reason is Withheld.TOO_UNCERTAIN:
        claim = f"target {_metres(figure)} m" if figure < MOST_M else "no claim"
        return f"{claim}, limit {_metres(limit_m)}"
    if refusal.reason is Withheld.NO_VEHICLE and not isfinite(figure):
        return "no attitude"
    return CAUSES[refusal.reason].format(figure)


def _metres(value: float) -> str:
    return f"{value:.2f}" if value < 9.995 else f"{value:.0f}"
