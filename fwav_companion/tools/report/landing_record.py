"""What a recording holds of a landing: the path over the pad, what was sent and withheld, and what was said. Pure."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import hypot, inf, nan

import msgspec

from fwav_companion.geometry.ellipses import radius_95
from fwav_companion.geometry.rotations import Quaternion, quaternion_from_euler, rotate
from fwav_companion.geometry.vectors import Vector3, subtract
from fwav_companion.mavlink.wire.enums import (
    MAV_AUTOPILOT_ARDUPILOTMEGA,
    MAV_AUTOPILOT_PX4,
    MAV_MODE_FLAG_SAFETY_ARMED,
)
from fwav_companion.publishing.enums import MAV_FRAME_BODY_FRD, MAV_FRAME_LOCAL_NED
from fwav_companion.recording.line_types import Line, TargetLine
from fwav_companion.types import Message

PAUSE_S = 0.5
"""Time without LANDING_TARGET that is listed: ArduPilot begins to wait for two seconds of messages after it."""
CAUSE_S = 1.5
"""Time after the end of a pause within which a text still explains it: a text is due after a second, and at most once
in five."""
COPY_S = 1.0
"""Time within which the same text is a copy that went another way, to a station and to the autopilot."""
OWN_TEXTS = ("pad ", "landed", "LANDING_TARGET")
"""Beginnings of the service's own texts about a landing."""
CAUSE_TEXTS = ("pad lost: ", "LANDING_TARGET withheld: ")
AUTOPILOT_TEXTS = ("PrecLand", "Plnd", "Landing", "Precision")
"""Words of the autopilots' own texts about a landing."""
COPTERS = frozenset({2, 3, 4, 13, 14, 15, 29, 35})
"""MAV_TYPE of the vehicles that ArduCopter flies."""
COPTER_MODES = {
    0: "Stabilize", 2: "AltHold", 3: "Auto", 4: "Guided", 5: "Loiter", 6: "RTL", 7: "Circle", 9: "Land", 16: "PosHold",
    17: "Brake", 21: "SmartRTL",
}  # fmt: skip
PX4_MODES = {
    (1, 0): "Manual", (2, 0): "Altitude", (3, 0): "Position", (4, 2): "Takeoff", (4, 3): "Hold", (4, 4): "Mission",
    (4, 5): "Return", (4, 6): "Land", (4, 9): "Precision land", (6, 0): "Offboard",
}  # fmt: skip
"""Names by custom_mode: of ArduCopter, and of PX4 by main and sub mode."""
DISARMED = "disarmed"


class LandingPoint(msgspec.Struct, frozen=True):
    """The vehicle about the landing point by one LANDING_TARGET, metres."""

    at_s: float
    north: float
    east: float
    height: float
    radius95_m: float
    """Claimed radius of the track relative to the vehicle then, 95 %; NaN where it is not known."""
    seen: bool
    """Whether the newest picture then showed the pad."""

    @property
    def offset_m(self) -> float:
        """Horizontal distance."""
        return hypot(self.north, self.east)


class LandingPause(msgspec.Struct, frozen=True):
    """A time without LANDING_TARGET although the pad had been found."""

    from_s: float
    to_s: float
    why: str
    """The service's own text; "" where it gave none."""


class LandingEvent(msgspec.Struct, frozen=True):
    """A text, or a change of the flight mode."""

    at_s: float
    by: str
    text: str


class RecordedMessages(msgspec.Struct, frozen=True):
    """The messages of a recording that holds a landing."""

    messages: Sequence[tuple[int, Message]]
    """With their Unix microseconds."""
    own: frozenset[int]
    """Component ids of the service."""
    label: str
    """[publish] landing_label."""


class LandingRecord(msgspec.Struct, frozen=True):
    """One flight's landing."""

    points: list[LandingPoint]
    sent: int
    """Number of LANDING_TARGET messages."""
    pauses: list[LandingPause]
    events: list[LandingEvent]

    @property
    def last_seen(self) -> LandingPoint | None:
        """The point by the last picture that showed the pad; None where no picture did."""
        return next((point for point in reversed(self.points) if point.seen), None)

    def height_at(self, at_s: float) -> float | None:
        """Height above the landing point at the message nearest to an instant; None without one within a second."""
        index = bisect_left(self.points, at_s, key=lambda each: each.at_s)
        near = min(self.points[max(0, index - 1) : index + 1], key=lambda each: abs(each.at_s - at_s), default=None)
        return None if near is None or abs(near.at_s - at_s) > 1.0 else near.height


def landing_record(lines: Sequence[Line], recorded: RecordedMessages, start_unix: float) -> LandingRecord | None:
    """The landing in the lines of a replay and the recorded messages; None where no LANDING_TARGET was recorded."""
    timed = [(unix_us * 1e-6 - start_unix, message) for unix_us, message in recorded.messages]
    sent_s = [at_s for at_s, each in timed if _is_sent(each, recorded.own)]
    if not sent_s:
        return None
    claims = [
        _Claim(line.time_unix - start_unix, _radius_95_m(line), line.fix is not None)
        for line in lines
        if isinstance(line, TargetLine) and line.label == recorded.label and line.is_confirmed
    ]
    points = [
        LandingPoint(at_s, -north, -east, down, *_claim_at(claims, at_s))
        for at_s, (north, east, down) in _vectors(timed, recorded.own)
    ]
    events = sorted([*_texts(timed, recorded.own), *_modes(timed)], key=lambda each: each.at_s)
    ends = [each.at_s for each in events if each.text == DISARMED and each.at_s > sent_s[-1]]
    return LandingRecord(points, len(sent_s), _pauses([*sent_s, *ends[:1]], events), events)


def _is_sent(message: Message, own: frozenset[int]) -> bool:
    return message.name == "LANDING_TARGET" and message.component in own


class _Claim(msgspec.Struct, frozen=True):
    at_s: float
    radius95_m: float
    seen: bool


def _radius_95_m(line: TargetLine) -> float:
    return nan if line.relative is None else radius_95(line.relative.cov)


def _claim_at(claims: Sequence[_Claim], at_s: float) -> tuple[float, bool]:
    """Claimed radius, and whether the pad was seen, in the newest picture that an instant knows."""
    index = bisect_left(claims, at_s, key=lambda each: each.at_s) - 1
    return (nan, False) if index < 0 else (claims[index].radius95_m, claims[index].seen)


def _vectors(timed: Sequence[tuple[float, Message]], own: frozenset[int]) -> Iterator[tuple[float, Vector3]]:
    """What each LANDING_TARGET says: from the vehicle to the landing point, NED, metres.

    ArduPilot's is in body axes: the newest attitude turns it. PX4's is in its own local frame: its newest position is
    subtracted.
    """
    ned_from_body: Quaternion | None = None
    local: Vector3 | None = None
    for at_s, message in timed:
        fields = message.fields
        if message.name == "ATTITUDE":
            ned_from_body = quaternion_from_euler(fields.roll, fields.pitch, fields.yaw)
        elif message.name == "ATTITUDE_QUATERNION":
            ned_from_body = (fields.q1, fields.q2, fields.q3, fields.q4)
        elif message.name == "LOCAL_POSITION_NED":
            local = (fields.x, fields.y, fields.z)
        elif _is_sent(message, own):
            place = (fields.x, fields.y, fields.z)
            if fields.frame == MAV_FRAME_BODY_FRD and ned_from_body is not None:
                yield at_s, rotate(ned_from_body, place)
            elif fields.frame == MAV_FRAME_LOCAL_NED and local is not None:
                yield at_s, subtract(place, local)


def _pauses(sent_s: Sequence[float], events: Sequence[LandingEvent]) -> list[LandingPause]:
    causes = [each for each in events if each.text.startswith(CAUSE_TEXTS)]
    pauses = []
    for before_s, after_s in pairwise(sent_s):
        if after_s - before_s > PAUSE_S:
            why = [each.text for each in causes if before_s - CAUSE_S <= each.at_s <= after_s + CAUSE_S]
            pauses.append(LandingPause(before_s, after_s, why[-1].partition(": ")[2] if why else ""))
    return pauses


def _texts(timed: Sequence[tuple[float, Message]], own: frozenset[int]) -> Iterator[LandingEvent]:
    """The texts about a landing, of the service and of the autopilot; a text that went two ways counts once."""
    last_s: dict[tuple[str, str], float] = {}
    for at_s, message in timed:
        if message.name != "STATUSTEXT":
            continue
        by_service, text = message.component in own, message.fields.text
        is_of_landing = text.startswith(OWN_TEXTS) if by_service else any(word in text for word in AUTOPILOT_TEXTS)
        by = "service" if by_service else "autopilot"
        is_copy = at_s - last_s.get((by, text), -inf) < COPY_S
        last_s[by, text] = at_s
        if is_of_landing and not is_copy:
            yield LandingEvent(at_s, by, text)


def _modes(timed: Sequence[tuple[float, Message]]) -> Iterator[LandingEvent]:
    """The autopilot's flight modes as they change, and when it is disarmed."""
    mode, armed = None, False
    for at_s, message in timed:
        fields = message.fields
        if message.name != "HEARTBEAT" or fields.autopilot not in (MAV_AUTOPILOT_ARDUPILOTMEGA, MAV_AUTOPILOT_PX4):
            continue
        if fields.custom_mode != mode:
            mode = fields.custom_mode
            yield LandingEvent(at_s, "autopilot", f"mode {_mode_name(fields.autopilot, fields.type, mode)}")
        was, armed = armed, bool(fields.base_mode & MAV_MODE_FLAG_SAFETY_ARMED)
        if was != armed:
            yield LandingEvent(at_s, "autopilot", "armed" if armed else DISARMED)


def _mode_name(autopilot: int, vehicle_type: int, number: int) -> str:
    """Name of a custom_mode, else its number."""
    if autopilot == MAV_AUTOPILOT_PX4:
        main, sub = number >> 16 & 0xFF, number >> 24
        return PX4_MODES.get((main, sub), f"{main}.{sub}")
    return COPTER_MODES.get(number, f"{number}") if vehicle_type in COPTERS else f"{number}"
