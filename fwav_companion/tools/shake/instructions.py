"""Instructions to the person who holds the vehicle, from the data received so far, a few times a second."""

from __future__ import annotations

from enum import StrEnum
from math import pi, radians
from typing import Final

import msgspec

from fwav_companion.geometry.vectors import Vector3

HALF_S: Final = 10.0
"""Seconds of shaking before the turn by 90 deg, and again after it."""
PATIENCE_S: Final = 20.0
"""Extra seconds for a turn that is not complete when the time is over."""
TURNED: Final = radians(60.0)
SIDE_S: Final = 4.0
"""Least seconds of shaking on each side of the turn."""
SLOWEST_HZ: Final = 20.0
"""Attitude rate; a slower one does not show a hand's motion."""
SOON_S: Final = 4.0
NARROW: Final = radians(5.0)
"""Least swing in roll or pitch, radians: below it, the person is asked after SOON_S to swing wider."""
GONE_S: Final = 2.0
"""Seconds without the tag before it is reported as lost."""


class ShakePhase(StrEnum):
    """Phase of the session."""

    WAITING = "waiting"
    SHAKING = "shaking"
    DONE = "done"
    FAILED = "failed"


class ShakeInputs(msgspec.Struct, frozen=True, kw_only=True):
    """Summary of the data received so far."""

    now_s: float
    closed: str = ""
    """A link or port that could not be opened, and why."""
    autopilot: bool = False
    attitude_hz: float = 0.0
    clock_known: bool = False
    frames: int = 0
    """Number of frames so far."""
    tags: int = 0
    """Number of them with the corners of a tag."""
    attitude: Vector3 | None = None
    """Roll, pitch and heading, radians."""


class Instruction(msgspec.Struct, frozen=True):
    """The instruction of the moment, and the progress."""

    phase: ShakePhase
    text: str
    """The instruction, or the missing input."""
    share: float = 0.0
    """Completed share of the shaking."""
    left_s: float | None = None
    """Remaining time of this instruction, seconds; None: until its effect is seen."""
    corners: int = 0
    """Number of corners so far."""
    swung: tuple[float, float] = (0.0, 0.0)
    """Half ranges of roll and pitch so far, radians."""


class Instructor:
    """Decides the instructions of one session."""

    def __init__(self, wait_s: float) -> None:
        """``wait_s``: seconds until a vehicle or tag that is missing ends the session."""
        self._wait_s = wait_s
        self._first_s: float | None = None
        self._begun_s: float | None = None
        self._turned_s: float | None = None
        self._heading = 0.0  # unwrapped
        self._ranges: list[tuple[float, float]] = []  # of roll, pitch and heading
        self._tags, self._tag_s, self._tags_before = 0, 0.0, 0

    @property
    def begun(self) -> bool:
        """Whether the shaking has begun: frames count from now on."""
        return self._begun_s is not None

    def instruct(self, inputs: ShakeInputs) -> Instruction:
        """The instruction at this instant."""
        if self._first_s is None:
            self._first_s = inputs.now_s
        if inputs.tags > self._tags:
            self._tags, self._tag_s = inputs.tags, inputs.now_s
        if self._begun_s is None:
            missing = _missing(inputs)
            if missing:
                over = inputs.now_s - self._first_s > self._wait_s
                return Instruction(ShakePhase.FAILED if over else ShakePhase.WAITING, missing)
            self._begun_s, self._tags_before = inputs.now_s, inputs.tags
        if inputs.attitude is not None:
            self._follow(inputs.attitude, inputs.now_s)
        instruction = self._shaking(inputs.now_s)
        corners = 4 * (self._tags - self._tags_before)
        return msgspec.structs.replace(instruction, corners=corners, swung=self._swung())

    def _follow(self, attitude: Vector3, now_s: float) -> None:
        """Extend the range of each angle; the heading is unwrapped."""
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

    def _shaking(self, now_s: float) -> Instruction:
        begun_s = self._begun_s or now_s
        elapsed_s = now_s - begun_s
        end_s = 2.0 * HALF_S if self._turned_s is None else max(2.0 * HALF_S, self._turned_s - begun_s + SIDE_S)
        share = min(1.0, elapsed_s / end_s)
        if (elapsed_s >= end_s and self._turned_s is not None) or elapsed_s >= 2.0 * HALF_S + PATIENCE_S:
            return Instruction(ShakePhase.DONE, "done: put it down", 1.0)
        if now_s - self._tag_s > GONE_S:
            return Instruction(ShakePhase.SHAKING, "the tag is out of sight: hold the camera over the tag", share)
        if elapsed_s < HALF_S:
            narrow = elapsed_s > SOON_S and min(self._swung()) < NARROW
            text = "shake it wider, in roll and in pitch" if narrow else "shake it in roll, pitch and a little yaw"
            return Instruction(ShakePhase.SHAKING, text, share, HALF_S - elapsed_s)
        if self._turned_s is None:
            return Instruction(ShakePhase.SHAKING, "now turn it by 90 deg, and go on shaking", share)
        return Instruction(ShakePhase.SHAKING, "go on shaking", share, max(0.0, end_s - elapsed_s))


def _missing(inputs: ShakeInputs) -> str:
    """The first thing that is missing, from the link to the tag; "" if everything is there."""
    if inputs.closed:
        return inputs.closed
    if not inputs.autopilot:
        return "no autopilot is heard: `check` without --shake says what arrives on each link"
    if inputs.attitude_hz < SLOWEST_HZ:
        hz = inputs.attitude_hz
        received = f"attitudes come {hz:.0f} times a second" if hz else "no attitude comes"
        return f"{received}, at least {SLOWEST_HZ:.0f} Hz are needed: `check` without --shake says what was requested"
    if not inputs.clock_known:
        return "the autopilot's clock is not known yet: it does not answer TIMESYNC"
    if not inputs.frames:
        return "no pictures and no detections arrive: is the camera, or the detector, running?"
    if not inputs.tags:
        return "pictures arrive, but no tag with its four corners: hold the camera over the printed tag"
    return ""
