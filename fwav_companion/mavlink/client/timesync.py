"""Exchanges TIMESYNC (111): our requests, whose answers measure the autopilot's clock, and our answers to requests.

A request carries our clock in ts1 and tc1 = 0; its answer mirrors ts1 and carries the responder's clock in tc1, both in
nanoseconds. Exchanges of other components pass on the same links, so an answer counts only if we sent its ts1 and it
came from our autopilot. PX4, in turn, accepts any answer as an answer to itself: we answer only our autopilot, and
requests that name us.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, NS_PER_US, BootNs, HostNs
from fwav_companion.types.messages import Destination, Message, Outgoing
from fwav_companion.types.network_status import TimesyncReport
from fwav_companion.types.situation import Autopilot, AutopilotKind
from fwav_companion.types.telemetry import ClockExchange

DOUBT_INTERVAL_NS = 100 * NS_PER_MS
"""Interval until three exchanges agree, and while the clock is in doubt: ten requests a second."""
INTERVAL_NS = NS_PER_S
DOUBT_NS = NS_PER_S // 2
"""Time after the last doubtful answer for which requests stay frequent."""
UNANSWERED, ONE_WAY_INTERVAL_NS = 20, 10 * NS_PER_S
"""Number of unanswered requests after which the autopilot counts as one-way, and the interval from then on."""
HELD_BACK_NS, HELD_BACK_UNANSWERED_NS = 2 * NS_PER_S, NS_PER_S
"""Longest time for which our other requests wait for three exchanges that agree, and for a first answer: ArduPilot
dates reception back by what it has not read, so the first exchange beside a burst of our own was 115 ms off."""
REQUEST_BYTES, BITS_A_BYTE = 28, 10
"""Bytes of a TIMESYNC frame without its signature, and bits of a byte on a serial line."""
UNKNOWN_BAUD = 115200
"""Baud rate of the autopilot's own port behind UDP or TCP: a bridge or a radio."""
MOST_CLOCK_NS = 2**63 - 1
KEPT_ROUND_TRIPS = 16
JITTER_SHARE = 1.0 / 16.0
"""Weight of the newest change of the round trip in its running mean, as in RTP (RFC 3550, 6.4.1)."""

MAX_OUTSTANDING = 32
EXPIRY_NS = 5 * NS_PER_S
"""Time after which a request expires: longer than the round trip of any useful link. A later answer would bound
nothing."""


class NotTaken(StrEnum):
    """Reason why a TIMESYNC was ignored."""

    NO_AUTOPILOT = "no_autopilot"
    """No autopilot is adopted: we neither send requests nor answer."""
    NOT_OURS = "not_ours"
    """An answer to another component's request, or a late answer."""
    REPLAYED = "replayed"
    """A second answer to one request over one link."""
    FOREIGN_SPEAKER = "foreign_speaker"
    """An answer to our request, but not from our autopilot."""
    OTHER_TARGET = "other_target"
    """Its target fields name another component."""
    BAD_CLOCK = "bad_clock"
    """The responder's clock is not positive, or the largest number there is."""
    NOT_FOR_US = "not_for_us"
    """A request from a component that is not our autopilot, without our address."""


class Ignored(msgspec.Struct, frozen=True):
    """The message was a TIMESYNC that needs no action, for this reason."""

    reason: NotTaken


class SentRequest(msgspec.Struct, gc=False):
    """A request that was sent."""

    sent_ns: HostNs
    foreign_bytes: int | None
    """Bytes of other systems' frames before it; None where nothing counts them."""
    answered: list[str]
    """Links over which its answer came."""


TimesyncResult: TypeAlias = ClockExchange | Outgoing | Ignored


class Timesync:
    """One side of the exchange. ``now`` is the time of sending or arrival, in whole microseconds."""

    def __init__(
        self,
        component: int = 191,
        *,
        target_fields: bool = False,
        salt: int = 0,
        bauds: Mapping[str, int] | None = None,
    ):
        """``bauds``: baud rates of the serial links, by name."""
        self._bauds = bauds or {}
        self.foreign_bytes: Callable[[], int] | None = None
        """Returns the bytes of other systems' frames so far, which are relayed to the autopilot; None: not counted."""
        self._component = component
        self._target_fields = target_fields
        self._counter = salt
        self._autopilot: Autopilot | None = None
        self._outstanding: dict[int, SentRequest] = {}
        self._round_trips_ns: list[int] = []
        self._jitter_ns = 0.0
        self._doubt_until_ns = HostNs(0)
        self._unanswered = 0
        self._answered = False
        self.held_until_ns = HostNs(0)
        """Instant until which our other requests to the autopilot wait for three exchanges that agree."""
        self.wake_at: HostNs | None = None
        """Time of the next request; None while no autopilot is adopted."""
        self.ignored: dict[NotTaken, int] = dict.fromkeys(NotTaken, 0)
        self.exchanges = 0
        self._requests = 0

    def adopt(self, autopilot: Autopilot, now: HostNs) -> None:
        """Exchange with this autopilot from now on, under its system id."""
        self._autopilot = autopilot
        self.restart(now)

    def restart(self, now: HostNs) -> None:
        """Start over with a new clock (autopilot adopted or rebooted): forget the pending requests, and settle
        again.
        """
        self._requests = 0
        self._outstanding.clear()
        self._round_trips_ns.clear()
        self._jitter_ns = 0.0
        self._answered = False
        self._unanswered = 0
        self.held_until_ns = HostNs(now + HELD_BACK_UNANSWERED_NS)
        self.wake_at = now

    def settle(self, now: HostNs) -> None:
        """Request ten times a second for a while, because the clock is in doubt."""
        self._doubt_until_ns = HostNs(now + DOUBT_NS)
        if self.wake_at is not None and not self.one_way:
            self.wake_at = min(self.wake_at, HostNs(now + DOUBT_INTERVAL_NS))

    def leaves_link_free(self, now: HostNs) -> bool:
        """Return whether our other requests may leave now: the first exchanges have the link to themselves."""
        return now >= self.held_until_ns

    def agreed(self) -> None:
        """Release our other requests: three exchanges agree."""
        self.held_until_ns = HostNs(0)

    @property
    def one_way(self) -> bool:
        """Whether the autopilot counts as one-way, because the last requests were not answered."""
        return self._unanswered >= UNANSWERED

    def on_wake(self, now: HostNs) -> Outgoing | None:
        """Return the request that is due. ``now`` must be the time of sending: half of any later wait biases the
        clock.
        """
        if self._autopilot is None or self.wake_at is None or now < self.wake_at:
            return None
        ts1 = now + self._nonce()
        self.on_sent(ts1, now, None if self.foreign_bytes is None else self.foreign_bytes())
        frequent = not self._answered or now < self._doubt_until_ns
        interval_ns = DOUBT_INTERVAL_NS if frequent else INTERVAL_NS
        self.wake_at = HostNs(now + (ONE_WAY_INTERVAL_NS if self.one_way else interval_ns))
        fields = {"tc1": 0, "ts1": ts1} | self._target(self._autopilot.system, self._autopilot.component)
        return Outgoing(name="TIMESYNC", fields=fields, to=Destination.AUTOPILOT, component=self._component)

    def on_sent(self, ts1: int, now: HostNs, foreign_bytes: int | None = None) -> None:
        """Note a request that left at ``now``: a replay takes it from the recording, with the ``foreign_bytes`` before
        it.
        """
        while self._outstanding:
            oldest = next(iter(self._outstanding))
            if len(self._outstanding) < MAX_OUTSTANDING and self._outstanding[oldest].sent_ns + EXPIRY_NS > now:
                break
            del self._outstanding[oldest]
        self._outstanding[ts1] = SentRequest(now, foreign_bytes, [])
        self._requests += 1
        self._unanswered += 1

    def on_message(self, message: Message, now: HostNs) -> TimesyncResult:
        """Process an answer or a request that arrived at ``now``."""
        if self._autopilot is None:
            return self._ignore(NotTaken.NO_AUTOPILOT)
        return self._on_request(message, now) if message.fields.tc1 == 0 else self._on_answer(message, now)

    def status(self) -> TimesyncReport:
        """Return the last round trips to the autopilot, for the status file."""
        trips = self._round_trips_ns
        return TimesyncReport(
            requests=self._requests,
            exchanges=self.exchanges,
            round_trip_s=trips[-1] / NS_PER_S if trips else None,
            least_round_trip_s=min(trips) / NS_PER_S if trips else None,
            jitter_s=self._jitter_ns / NS_PER_S if len(trips) > 1 else None,
            ignored={str(reason): count for reason, count in self.ignored.items() if count},
        )

    def _on_answer(self, message: Message, now: HostNs) -> ClockExchange | Ignored:
        fields = message.fields
        request = self._outstanding.get(fields.ts1)
        if request is None or not request.sent_ns <= now <= request.sent_ns + EXPIRY_NS:
            return self._ignore(NotTaken.NOT_OURS)
        if not self._is_from_autopilot(message):
            return self._ignore(NotTaken.FOREIGN_SPEAKER)
        if _target_of(message) not in {(0, 0), self._own_address()}:
            return self._ignore(NotTaken.OTHER_TARGET)
        if not 0 < fields.tc1 < MOST_CLOCK_NS:
            return self._ignore(NotTaken.BAD_CLOCK)
        if message.link in request.answered:
            return self._ignore(NotTaken.REPLAYED)
        if not request.answered:
            self._learn_round_trip(now - request.sent_ns, now)
        request.answered.append(message.link)
        return self._exchange(message, request, now)

    def _exchange(self, message: Message, request: SentRequest, now: HostNs) -> ClockExchange:
        """The exchange, with the times on the line by which its stamp may be early."""
        byte_ns = BITS_A_BYTE * NS_PER_S // self._bauds.get(message.link, UNKNOWN_BAUD)
        # Relayed bytes behind the request date its reception back on any autopilot but PX4, whose stamp is the reading.
        px4 = self._autopilot is not None and self._autopilot.kind is AutopilotKind.PX4
        counted = request.foreign_bytes is not None and not px4
        beside = max(0, message.foreign_bytes - (request.foreign_bytes or 0)) if counted else 0
        request_ns = 0
        ardupilot = self._autopilot is not None and self._autopilot.kind is AutopilotKind.ARDUPILOT
        if ardupilot and message.link in self._bauds:
            request_ns = REQUEST_BYTES * byte_ns
            if now - request.sent_ns < 2 * request_ns:  # the baud rate of a USB port means nothing
                request_ns = 0
        return ClockExchange(
            sent_ns=request.sent_ns,
            received_ns=now,
            autopilot_ns=BootNs(message.fields.tc1),
            link=message.link,
            request_ns=request_ns,
            beside_ns=beside * byte_ns,
        )

    def _on_request(self, message: Message, now: HostNs) -> Outgoing | Ignored:
        target = _target_of(message)
        names_us = target == self._own_address()
        if not names_us and not (self._is_from_autopilot(message) and target == (0, 0)):
            return self._ignore(NotTaken.NOT_FOR_US)
        fields = {"tc1": int(now), "ts1": message.fields.ts1} | self._target(message.system, message.component)
        return Outgoing(
            name="TIMESYNC", fields=fields, to=Destination.REPLY, component=self._component, link=message.link
        )

    def _learn_round_trip(self, round_trip_ns: int, now: HostNs) -> None:
        self.exchanges += 1
        if self._round_trips_ns:
            change_ns = abs(round_trip_ns - self._round_trips_ns[-1])
            self._jitter_ns += JITTER_SHARE * (change_ns - self._jitter_ns)
        self._round_trips_ns = [*self._round_trips_ns[1 - KEPT_ROUND_TRIPS :], round_trip_ns]
        if not self._answered and now < self.held_until_ns:
            self.held_until_ns = HostNs(self.held_until_ns + HELD_BACK_NS - HELD_BACK_UNANSWERED_NS)
        self._answered = True
        self._unanswered = 0
        if self.wake_at is not None:
            self.wake_at = min(self.wake_at, HostNs(now + INTERVAL_NS))

    def _nonce(self) -> int:
        """Return 0 to 999, for the digits below a microsecond, so that another component's ts1 does not equal ours by
        chance.

        The mixing is Steele's SplitMix64: each count gives another value, in an order that is hard to predict.
        """
        self._counter += 1
        mixed = self._counter * 0x9E3779B97F4A7C15 & 0xFFFFFFFFFFFFFFFF
        mixed = (mixed ^ mixed >> 30) * 0xBF58476D1CE4E5B9 & 0xFFFFFFFFFFFFFFFF
        mixed = (mixed ^ mixed >> 27) * 0x94D049BB133111EB & 0xFFFFFFFFFFFFFFFF
        return (mixed ^ mixed >> 31) % NS_PER_US

    def _is_from_autopilot(self, message: Message) -> bool:
        return self._autopilot is not None and (message.system, message.component) == (
            self._autopilot.system,
            self._autopilot.component,
        )

    def _own_address(self) -> tuple[int, int]:
        return (self._autopilot.our_system if self._autopilot is not None else 0, self._component)

    def _target(self, system: int, component: int) -> dict[str, int]:
        """Return the target fields of TIMESYNC version 2 if our definitions have them; ArduPilot's do not."""
        return {"target_system": system, "target_component": component} if self._target_fields else {}

    def _ignore(self, reason: NotTaken) -> Ignored:
        self.ignored[reason] += 1
        return Ignored(reason)


def _target_of(message: Message) -> tuple[int, int]:
    """Return the target fields of TIMESYNC version 2; (0, 0) if the sender or our definitions have none."""
    fields = message.fields
    return (getattr(fields, "target_system", 0), getattr(fields, "target_component", 0))
