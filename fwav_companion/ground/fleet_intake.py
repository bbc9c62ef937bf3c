"""Intake of vehicles' messages: joins parts, drops late ones, maps times to one clock, and reports errors. Pure.

A vehicle's clock may be off by any amount: only differences of its times count. The least difference of arrival and
stamp is taken as the offset; the excess of a message's difference over it is the delay of that message.
"""

from __future__ import annotations

import re
from collections import Counter, deque
from dataclasses import dataclass, field

from fwav_companion.fleet.options import FLEET_NAME, FUSION_NAME
from fwav_companion.fleet.payloads import (
    MAX_NAME,
    MAX_TRACKS,
    LocalTrack,
    SharedTrack,
    StateMessage,
    TracksMessage,
    VehicleBias,
    decoded,
)
from fwav_companion.ground.views import MAX_VEHICLES

MAX_SENDERS = 1000
"""Most names whose refused messages are counted."""
OFFSETS_KEPT = 120
"""Number of clock offsets that are kept: a minute at 2 Hz."""
CLOCK_OFF_S = 2.0
"""Least clock offset that is reported, seconds: beyond any delay of a network that works."""
LONGEST_DELAY_S = 5.0
SESSION_S = 5.0
"""Silence after which another sender may use a vehicle's name, seconds."""
FORGOTTEN_S = 60.0
"""Silence after which another vehicle may take a sender's place, if no place is free, seconds."""
REPEAT_S = 60.0
"""Least time between two reports of one kind about one vehicle."""


@dataclass(slots=True)
class WholeReport:
    """All tracks of one vehicle at one instant."""

    vehicle: str
    at_unix: float
    """Instant of the tracks on this process's clock, Unix seconds."""
    bias: VehicleBias
    tracks: tuple[SharedTrack, ...]
    local_tracks: tuple[LocalTrack, ...] = ()
    """Those in the vehicle's local world."""


@dataclass(slots=True)
class FleetSender:
    """One vehicle's sender."""

    session: str
    heard_unix: float
    seq: int = -1
    seq_unix: float = 0.0
    """Instant at which the newest message was complete."""
    parts: dict[int, tuple[SharedTrack, ...]] = field(default_factory=dict)
    parts_seq: int = -1
    offsets: deque[float] = field(default_factory=lambda: deque(maxlen=OFFSETS_KEPT))

    def delay_s(self, time_unix: float, now: float) -> float:
        """Delay of a message in excess of the fastest message's delay, seconds."""
        self.offsets.append(now - time_unix)
        return min(max(now - time_unix - min(self.offsets), 0.0), LONGEST_DELAY_S)

    @property
    def clock_offset_s(self) -> float:
        """Offset of the vehicle's clock: this process's clock minus it, including the shortest delay, seconds."""
        return min(self.offsets, default=0.0)


class FleetIntake:
    """Checks and joins messages."""

    def __init__(self) -> None:
        self.refused: Counter[str] = Counter()
        """Number of refused messages by reason."""
        self._senders: dict[str, FleetSender] = {}
        self._said: dict[tuple[str, str], float] = {}
        self._texts: list[tuple[str, str]] = []

    def knows(self, vehicle: str) -> bool:
        """Whether a vehicle has a sender."""
        return vehicle in self._senders

    def take_texts(self) -> list[tuple[str, str]]:
        """(vehicle, warning) of each warning since the last call."""
        texts, self._texts = self._texts, []
        return texts

    def on_tracks(self, vehicle: str, data: bytes, now: float) -> WholeReport | None:
        """All tracks of a vehicle if this message completes them; otherwise None."""
        if not self._may_send(vehicle, now):
            return None
        message = decoded(data, TracksMessage)
        if isinstance(message, str):
            self._refuse(vehicle, message, now)
            return None
        sender = self._sender(vehicle, message.session, now)
        if sender is None:
            return None
        # One forged or damaged number must not outdate a vehicle's messages for good.
        if message.seq <= sender.seq and now <= sender.seq_unix + SESSION_S:
            self.refused["late"] += 1
            return None
        if message.seq != sender.parts_seq:
            sender.parts, sender.parts_seq = {}, message.seq
        sender.parts[message.part] = message.tracks
        delay_s = sender.delay_s(message.time_unix, now)
        self._check_clock(vehicle, sender, now)
        if len(sender.parts) < message.parts:
            return None
        sender.seq, sender.seq_unix = message.seq, now
        tracks = tuple(track for part in sorted(sender.parts) for track in sender.parts[part])
        sender.parts = {}
        return WholeReport(vehicle, now - delay_s, message.bias, tracks[:MAX_TRACKS], message.local_tracks)

    def on_state(self, vehicle: str, data: bytes, now: float) -> tuple[StateMessage, float] | None:
        """The state of a vehicle, and its instant on this process's clock, Unix seconds."""
        if not self._may_send(vehicle, now):
            return None
        message = decoded(data, StateMessage)
        if isinstance(message, str):
            self._refuse(vehicle, message, now)
            return None
        sender = self._sender(vehicle, message.session, now)
        return None if sender is None else (message, now - sender.delay_s(message.time_unix, now))

    def _sender(self, vehicle: str, session: str, now: float) -> FleetSender | None:
        """The sender of a vehicle that may send; None for a second sender with its name."""
        sender = self._senders.get(vehicle)
        if sender is None or (sender.session != session and now > sender.heard_unix + SESSION_S):
            if sender is None and len(self._senders) >= MAX_VEHICLES:
                del self._senders[self._longest_silent()]
            sender = self._senders[vehicle] = FleetSender(session, now)
        if sender.session != session:
            self.refused["second sender"] += 1
            text = "two senders have this name; the first counts. Give each its own [fleet] vehicle"
            self._say(vehicle, "second sender", text, now)
            return None
        sender.heard_unix = now
        return sender

    def _may_send(self, vehicle: str, now: float) -> bool:
        """Whether a vehicle has a place, or may get one. It is asked before a message is decoded, which costs more."""
        if vehicle == FUSION_NAME or re.fullmatch(FLEET_NAME, vehicle) is None:
            self._refuse(ascii(vehicle[:MAX_NAME]), "a name that no vehicle can have", now)
            return False
        if vehicle in self._senders or len(self._senders) < MAX_VEHICLES:
            return True
        if now > self._senders[self._longest_silent()].heard_unix + FORGOTTEN_S:
            return True
        self._refuse(vehicle, f"more than {MAX_VEHICLES} vehicles", now)
        return False

    def _longest_silent(self) -> str:
        return min(self._senders, key=lambda each: self._senders[each].heard_unix)

    def _check_clock(self, vehicle: str, sender: FleetSender, now: float) -> None:
        off_s = sender.clock_offset_s
        if abs(off_s) > CLOCK_OFF_S and len(sender.offsets) >= 3:
            text = f"its clock is off by {-off_s:.0f} s: only time differences are used. Synchronise it"
            self._say(vehicle, "clock", text, now)

    def _refuse(self, vehicle: str, reason: str, now: float) -> None:
        self.refused[reason] += 1
        self._say(vehicle, reason, f"sends what cannot be used ({reason}): update fwav-companion there", now)

    def _say(self, vehicle: str, kind: str, text: str, now: float) -> None:
        """Report, at most once a minute for a vehicle and kind; for all names without a place together."""
        key = (vehicle if vehicle in self._senders else "", kind)
        if now < self._said.get(key, -REPEAT_S) + REPEAT_S:
            return
        if len(self._said) >= MAX_SENDERS:
            del self._said[next(iter(self._said))]
        self._said[key] = now
        self._texts.append((vehicle, text))
