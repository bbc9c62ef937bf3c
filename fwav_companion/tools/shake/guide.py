"""What the person with the vehicle in hand is to do now. Told the moment, a few times a second."""

from __future__ import annotations

from enum import StrEnum
from math import pi, radians
from typing import Final

import msgspec

from fwav_companion.geometry.vectors import Vector3

HALF_S: Final = 10.0
"""Shaken for so long, turned by 90 deg, and for so long again."""
PATIENCE_S: Final = 20.0
"""For who has not turned it yet when the time is over."""
TURNED: Final = radians(60.0)
SIDE_S: Final = 4.0
"""So much of the time, at least, on each side of the turn."""
SLOWEST_HZ: Final = 20.0
"""Of attitudes: slower ones do not show what a hand does."""
SOON_S: Final = 4.0
NARROW: Final = radians(5.0)
"""Roll or pitch that swung to less than this after so long: the person may do more."""
GONE_S: Final = 2.0
"""Without the tag for so long, the person is told."""


class Phase(StrEnum):
    """How far it has come."""

    WAITING = "waiting"
    SHAKING = "shaking"
    DONE = "done"
    FAILED = "failed"


class Moment(msgspec.Struct, frozen=True, kw_only=True):
    """What is there now."""

    now_s: float
    closed: str = ""
    """A link or port that could not be opened, and why."""
    autopilot: bool = False
    attitude_hz: float = 0.0
    clock_known: bool = False
    frames: int = 0
    """That came so far."""
    tags: int = 0
    """Of them, with the corners of a tag."""
    attitude: Vector3 | None = None
    """Roll, pitch and heading, radians."""


class Advice(msgspec.Struct, frozen=True):
    """For the person."""

    phase: Phase
    text: str
    """What to do, or what is missing."""
    share: float = 0.0
    """Of the shaking that is done."""
    left_s: float | None = None
    """How long to go on with it; None: until it is seen."""
    corners: int = 0
    """Seen so far."""
    swung: tuple[float, float] = (0.0, 0.0)
    """Half of how far roll and pitch have swung so far, radians."""


class Guide:
    """One session."""

    def __init__(self, wait_s: float) -> None:
        """``wait_s``: so long may vehicle and tag take to be there."""
        self._wait_s = wait_s
        self._first_s: float | None = None
        self._begun_s: float | None = None
        self._turned_s: float | None = None
        self._heading = 0.0  # unwrapped
        self._ranges: list[tuple[float, float]] = []  # of roll, pitch and heading
        self._tags, self._tag_s, self._tags_before = 0, 0.0, 0

    @property
    def begun(self) -> bool:
        """What comes from now on counts."""
        return self._begun_s is not None

    def advise(self, moment: Moment) -> Advice:
        """What to do now."""
        if self._first_s is None:
            self._first_s = moment.now_s
        if moment.tags > self._tags:
            self._tags, self._tag_s = moment.tags, moment.now_s
        if self._begun_s is None:
            missing = _missing(moment)
            if missing:
                over = moment.now_s - self._first_s > self._wait_s
                return Advice(Phase.FAILED if over else Phase.WAITING, missing)
            self._begun_s, self._tags_before = moment.now_s, moment.tags
        if moment.attitude is not None:
            self._follow(moment.attitude, moment.now_s)
        advice = self._shaking(moment.now_s)
        return msgspec.structs.replace(advice, corners=4 * (self._tags - self._tags_before), swung=self._swung())

    def _follow(self, attitude: Vector3, now_s: float) -> None:
        """How far each angle has swung; the heading round and round."""
        roll, pitch, heading = attitude
        first = not self._ranges
        step = (heading - self._heading + pi) % (2.0 * pi) - pi
        self._heading = heading if first else self._heading + step
        angles = (roll, pitch, self._heading)
        before = [(angle, angle) for angle in angles] if first else self._ranges
        self._ranges = [(min(low, angle), max(high, angle)) for (low, high), angle in zip(before, angles, strict=True)]
        low, high = self._ranges[2]
        if self._turned_s is None and high - low >= TURNED:
            self._turned_s = now_s

    def _swung(self) -> tuple[float, float]:
        roll, pitch = (0.5 * (high - low) for low, high in self._ranges[:2]) if self._ranges else (0.0, 0.0)
        return roll, pitch

    def _shaking(self, now_s: float) -> Advice:
        begun_s = self._begun_s or now_s
        elapsed_s = now_s - begun_s
        end_s = 2.0 * HALF_S if self._turned_s is None else max(2.0 * HALF_S, self._turned_s - begun_s + SIDE_S)
        share = min(1.0, elapsed_s / end_s)
        if (elapsed_s >= end_s and self._turned_s is not None) or elapsed_s >= 2.0 * HALF_S + PATIENCE_S:
            return Advice(Phase.DONE, "done: put it down", 1.0)
        if now_s - self._tag_s > GONE_S:
            return Advice(Phase.SHAKING, "the tag is out of sight: hold it over the tag", share)
        if elapsed_s < HALF_S:
            narrow = elapsed_s > SOON_S and min(self._swung()) < NARROW
            text = "shake it wider, in roll and in pitch" if narrow else "shake it in roll, pitch and a little yaw"
            return Advice(Phase.SHAKING, text, share, HALF_S - elapsed_s)
        if self._turned_s is None:
            return Advice(Phase.SHAKING, "now turn it by 90 deg, and go on shaking", share)
        return Advice(Phase.SHAKING, "go on shaking", share, max(0.0, end_s - elapsed_s))


def _missing(moment: Moment) -> str:
    """The first thing that is not there, from the wire to the tag; "" if all is."""
    if moment.closed:
        return moment.closed
    if not moment.autopilot:
        return "no autopilot is heard: `check` without --shake says what comes over each link"
    if moment.attitude_hz < SLOWEST_HZ:
        told = f"attitudes come {moment.attitude_hz:.0f} times a second" if moment.attitude_hz else "no attitude comes"
        return f"{told}, at least {SLOWEST_HZ:.0f} Hz it takes: `check` without --shake says what was asked for"
    if not moment.clock_known:
        return "the autopilot's clock is not known yet: it answers no TIMESYNC"
    if not moment.frames:
        return "no pictures and no detections come in: is the camera, or the detector, running?"
    if not moment.tags:
        return "pictures come, but no tag with its four corners: hold the camera over the printed tag"
    return ""
