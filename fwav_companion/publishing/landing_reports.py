"""Texts for the pilot while a landing target is known and LANDING_TARGET is withheld, and when it flows again. Pure."""

from __future__ import annotations

from enum import StrEnum
from math import isfinite, nan
from typing import Final

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, HostNs, s_from_ns
from fwav_companion.types.messages import Notice, NoticeCode, Severity

WITHHELD_NS = NS_PER_S
"""Time without a message after which a text is due: ArduPilot loses its target after 2 s."""
APART_NS = 5 * NS_PER_S
"""Least time between two texts, so that a claim about the limit does not fill the pilot's screen."""
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


class LandingReports:
    """Decides when a text reports that LANDING_TARGET is withheld, and that it flows again."""

    def __init__(self, limit_m: float) -> None:
        """``limit_m``: landing_max_sigma_m."""
        self._limit_m = limit_m
        self._since_ns: HostNs | None = None
        self._reported = False
        self._text_ns: HostNs | None = None

    def withheld_s(self, now: HostNs) -> float | None:
        """Time for which the messages of a known target have been withheld, seconds; None where they flow."""
        return None if self._since_ns is None else s_from_ns(now - self._since_ns)

    @property
    def is_pending(self) -> bool:
        """Whether a text becomes due by the passing of time alone."""
        return self._since_ns is not None and not self._reported

    def on_lost(self) -> None:
        """Stop counting: there is no target, which has a notice of its own."""
        self._since_ns = None

    def on_sent(self, sigma_m: float, now: HostNs) -> Notice | None:
        """The notice after a message: that the messages flow, where the contrary was reported; else None.

        ``sigma_m``: the claim of the message.
        """
        self._since_ns = None
        if not self._reported or not self._may_speak(now):
            return None
        self._reported, self._text_ns = False, now
        text = f"LANDING_TARGET is sent: target {_metres(sigma_m)} m"
        return Notice(NoticeCode.LANDING_SENT, Severity.NOTICE, text, to_ground=True)

    def on_withheld(self, refusal: Refusal, now: HostNs) -> Notice | None:
        """The notice after a withheld message; None before it is due, and after it was given."""
        if self._since_ns is None:
            self._since_ns = now
        if self._reported or now - self._since_ns <= WITHHELD_NS or not self._may_speak(now):
            return None
        self._reported, self._text_ns = True, now
        text = f"LANDING_TARGET withheld: {_cause(refusal, self._limit_m)}"
        return Notice(NoticeCode.LANDING_WITHHELD, Severity.WARNING, text, to_ground=True)

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
