"""Drawn sequences of exchanges and arrivals of one kind each, the true clock known, and what a clock makes of them.

Times are seconds of the host; ``offset`` is host minus autopilot. A kind draws what differs from flight to flight.
"""

import random
from bisect import bisect_right
from dataclasses import dataclass, field, replace
from math import exp, inf, sqrt
from statistics import median

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.telemetry.clock.boot_time import BootTimeline, Restarted, Skipped
from fwav_companion.telemetry.clock.clock import Clock
from fwav_companion.telemetry.clock.clock_news import ClockNews
from fwav_companion.types import ClockExchange

HOST_NS = 9_000_000_000_000
FRAME_BYTES = 28
PROBE_S = 0.02
BURST = (20e-3, 150e-3)
LATE = (5e-3, 50e-3)


@dataclass(frozen=True)
class Kind:
    """All that a sequence is drawn from; times in seconds."""

    seconds: float = 50.0
    baud: int = 0
    """Of a serial line; 0: UDP."""
    first_bad: int = 0
    late_share: float = 0.0
    asymmetry_s: tuple[float, float] = (0.0, 0.0)
    rate: tuple[float, float] = (1.0, 1.0)
    """Of the 20 s from CHANGE_S on."""
    pause_s: float = 0.0
    reboot: bool = False
    halt_s: float = 0.0
    """Longest time for which the clock halts now and then; it makes each up at twice its rate."""
    answered_until_s: float = inf
    stream_hz: float = 20.0
    stream_base_s: float = 1e-3
    stream_jitter_s: float = 2e-3


CHANGE_S, CHANGED_S = 15.0, 20.0
MOST_PPM = 50.0
"""Largest rate of the autopilot's crystal against the host's."""
AWAY_S = 2.0
HALT_EVERY_S = 1.5

KINDS = {
    "a serial 115200": Kind(baud=115200),
    "a serial 921600": Kind(baud=921600),
    "a UDP": Kind(),
    "b first 1 off": Kind(first_bad=1),
    "b first 2 off": Kind(first_bad=2),
    "b first 3 off": Kind(first_bad=3),
    "c 10 % late one way": Kind(late_share=0.1),
    "d asymmetric to 4 ms": Kind(asymmetry_s=(-4e-3, 4e-3)),
    "e rate 0.5 to 1.5": Kind(rate=(0.5, 1.5)),
    "e slow-down to 0.8": Kind(rate=(0.8, 0.8)),
    "e pause of 0.3 s": Kind(pause_s=0.3),
    "e halts, made up": Kind(halt_s=4e-3),
    "f reboot": Kind(reboot=True),
    "h answers end": Kind(answered_until_s=20.0),
    **{
        f"g one-way {hz} Hz {name}": Kind(
            answered_until_s=-1.0, stream_hz=hz, stream_base_s=base_s, stream_jitter_s=jitter_s
        )
        for name, base_s, jitter_s in (("serial", 3.5e-3, 1e-3), ("UDP", 0.5e-3, 2e-3), ("radio", 30e-3, 10e-3))
        for hz in (10, 4, 1)
    },
}


@dataclass
class World:
    """The autopilot's clock as a piecewise linear function of the host's, and the wire between them."""

    kind: Kind
    rng: random.Random
    knots: list[tuple[float, float]] = field(default_factory=list)
    asymmetry_s: float = 0.0
    late_up: bool = True
    sent: int = 0

    @property
    def changes(self) -> list[tuple[float, float]]:
        """Beginning and end of each unannounced change."""
        kind = self.kind
        if kind.pause_s:
            return [(CHANGE_S, CHANGE_S + kind.pause_s)]
        if kind.reboot:
            return [(CHANGE_S, CHANGE_S + AWAY_S)]
        if kind.rate != (1.0, 1.0):
            return [(CHANGE_S, CHANGE_S), (CHANGE_S + CHANGED_S, CHANGE_S + CHANGED_S)]
        return []

    def boot(self, t: float) -> float:
        index = max(0, bisect_right(self.knots, (t, inf)) - 1)
        (t0, b0), (t1, b1) = self.knots[index], self.knots[min(index + 1, len(self.knots) - 1)]
        return b0 + (t - t0) * ((b1 - b0) / (t1 - t0) if t1 > t0 else 1.0)

    def runs(self, t: float) -> bool:
        return not ((self.kind.pause_s or self.kind.reboot) and self.changes[0][0] <= t < self.changes[0][1])

    @property
    def half_asymmetry_s(self) -> float:
        """Half the difference of the mean delays, which no exchange shows: the autopilot's loop waits on the way down
        alone.
        """
        return 0.5 * (0.3e-3 - 0.5e-3 - 1.25e-3 + self.asymmetry_s)

    def exchange(self, t: float) -> tuple[float, float, float, float] | None:
        """(sent, stamp, received, time of the request's bytes) of a request at t; None without an answer."""
        rng, kind = self.rng, self.kind
        self.sent += 1
        frame_s = FRAME_BYTES * 10.0 / kind.baud if kind.baud else 0.0
        base_s = 0.1e-3 if kind.baud else 1e-3
        up = base_s + rng.expovariate(1 / 0.3e-3) + max(0.0, self.asymmetry_s)
        down = base_s + rng.expovariate(1 / 0.5e-3) + rng.uniform(0.0, 2.5e-3) + max(0.0, -self.asymmetry_s)
        if rng.random() < kind.late_share:
            late = rng.uniform(*LATE)
            up, down = (up + late, down) if self.late_up else (up, down + late)
        arrives = t + up + frame_s
        if not self.runs(arrives):
            if kind.reboot:
                return None
            arrives = self.changes[0][1]
        if arrives > kind.answered_until_s:
            return None
        stamp = self.boot(arrives) - frame_s  # ArduPilot: the beginning of the request on the line
        if self.sent <= kind.first_bad:
            stamp += rng.choice((-1.0, 1.0)) * rng.uniform(*BURST)
        return t, stamp, arrives + down + frame_s, frame_s


def drawn(kind: Kind, seed: int) -> World:
    rng = random.Random(seed)
    start = rng.uniform(20.0, 3000.0)
    rate = rng.uniform(*kind.rate)
    world = World(kind, rng, asymmetry_s=rng.uniform(*kind.asymmetry_s), late_up=rng.random() < 0.5)
    ppm = rng.uniform(-MOST_PPM, MOST_PPM) * 1e-6
    t, b, knots = 0.0, start, [(0.0, start)]
    for length, speed in (
        [(CHANGE_S, 1.0), (CHANGED_S, rate), (1e4, 1.0)]
        if kind.rate != (1.0, 1.0)
        else [(CHANGE_S, 1.0), (kind.pause_s, 0.0), (1e4, 1.0)]
        if kind.pause_s
        else [(1e4, 1.0)]
    ):
        t, b = t + length, b + length * speed * (1.0 + ppm)
        knots.append((t, b))
    if kind.reboot:
        back = CHANGE_S + AWAY_S
        knots = [knots[0], (CHANGE_S, start + CHANGE_S), (back, 1.0), (back + 1e4, 1.0 + 1e4)]
    world.knots = _halted(kind, rng, start, ppm) if kind.halt_s else knots
    return world


def _halted(kind: Kind, rng: random.Random, start: float, ppm: float) -> list[tuple[float, float]]:
    """The clock of a simulator that halts and makes it up, as ArduCopter's was recorded."""
    t, away, knots = 0.0, 0.0, [(0.0, start)]
    while t < kind.seconds + 10.0:
        halt_s = rng.uniform(0.0, kind.halt_s)
        for length, rate in ((rng.expovariate(1.0 / HALT_EVERY_S), 0.0), (halt_s, -1.0), (halt_s, 1.0)):
            t, away = t + length, away + rate * length
            knots.append((t, start + t * (1.0 + ppm) + away))
    return knots


class PublishedFilter:
    """The TIMESYNC filter of PX4 and of mavros with its published gains: exponential smoothing of offset and skew."""

    def __init__(self) -> None:
        self.count, self.bad, self.offset, self.skew = 0, 0, 0.0, 0.0

    def add(self, sent: float, stamp: float, received: float) -> None:
        measured = 0.5 * (sent + received) - stamp
        if received - sent >= 0.010:
            return
        if self.count >= 500 and abs(measured - self.offset) > 0.1:
            self.bad += 1
            if self.bad > 5:
                self.__init__()  # type: ignore[misc]
            return
        if self.count == 0:
            self.offset = measured
        share = min(self.count / 500.0, 0.999)
        mix = 1.0 - exp(0.5 * (1.0 - 1.0 / (1.0 - share)))
        gain = 0.003 * mix + 0.05 * (1.0 - mix) if self.count < 500 else 0.003
        offset = gain * measured + (1.0 - gain) * (self.offset + self.skew)
        self.skew = gain * (offset - self.offset) + (1.0 - gain) * self.skew
        self.offset, self.count, self.bad = offset, self.count + 1, 0


@dataclass
class Flown:
    """What a clock made of one sequence."""

    world: World
    probes: list[tuple[float, float, float, float, float]] = field(default_factory=list)
    """(t, error, sigma, sigma without its asymmetry, error of the published filter), seconds."""
    arrivals: list[tuple[float, float]] = field(default_factory=list)
    """(arrival, stamp) of each message, seconds."""
    news: list[ClockNews] = field(default_factory=list)
    three_good_s: float = inf
    """Instant of the third good exchange, or arrival where none is answered."""
    heard_again_s: float = inf

    def healed_s(self, limit_s: float) -> list[float]:
        """Time from the third good exchange, or the end of a change, until the error stays below the limit."""
        ends = [self.three_good_s, *(max(end, 0.0) for _, end in self.world.changes)]
        if self.world.kind.reboot:
            ends[-1] = self.heard_again_s
        healed = []
        for index, end in enumerate(ends):
            until = self.world.changes[index][0] if index < len(self.world.changes) else self.world.kind.seconds
            wrong = [t for t, error, *_ in self.probes if end <= t < until and abs(error) > limit_s]
            healed.append(max(wrong) + PROBE_S - end if wrong else 0.0)
        return healed

    def outside(self) -> tuple[int, int]:
        """(probes beyond three sigmas, probes) where a claim was made, without the first 0.3 s after a change."""
        judged = [
            abs(error) > 3.0 * sigma
            for t, error, sigma, *_ in self.probes
            if sigma < inf and not any(a <= t < b + 0.3 for a, b in self.world.changes) and self.world.runs(t)
        ]
        return sum(judged), len(judged)

    def steady(self) -> list[tuple[float, float, float, float, float]]:
        """Probes 5 s and more after the start and after each change."""
        changes = [(0.0, 0.0), *self.world.changes]
        return [probe for probe in self.probes if not any(a <= probe[0] < b + 5.0 for a, b in changes)]

    def steady_error_s(self) -> float:
        """Median of the steady error beyond the half asymmetry (one-way: beyond the least delay)."""
        kind = self.world.kind
        known = kind.stream_base_s if kind.answered_until_s < 0.0 else abs(self.world.half_asymmetry_s)
        return median(abs(error) for _, error, *_ in self.steady()) - known


def fly(kind: Kind, seed: int, clock: Clock | None = None) -> Flown:  # noqa: C901 (one loop over the events of a link)
    """Let a clock estimate one drawn sequence, asked as the service asks."""
    world = drawn(kind, seed)
    clock, published, timeline = clock or Clock(), PublishedFilter(), BootTimeline()
    flown = Flown(world)
    events: list[tuple[float, int, tuple[float, ...]]] = []  # answers and messages under way
    order = good = unanswered = 0
    ask_s, stream_s, newest, t = 0.05, 0.0, 0.0, 0.0
    rng = random.Random(f"{seed}/stream")
    while t < kind.seconds:
        t = round(t + PROBE_S / 4.0, 6)
        while stream_s <= t:
            if world.runs(stream_s):
                late = kind.stream_base_s + rng.expovariate(1.0 / kind.stream_jitter_s)
                newest = max(newest, stream_s + late)  # the wire keeps the order
                order += 1
                events.append((newest, order, (world.boot(stream_s),)))
            stream_s += 1.0 / kind.stream_hz
        if t >= ask_s:
            exchange = world.exchange(t)
            unanswered += 1
            hz = 0.1 if unanswered > 20 else 10.0 if clock.in_doubt else 1.0
            ask_s = t + 1.0 / hz
            if exchange is not None:
                order += 1
                events.append((exchange[2], order, exchange))
        due = sorted(event for event in events if event[0] <= t)
        events = [event for event in events if event[0] > t]
        for at, _, event in due:
            arrival_ns = HostNs(HOST_NS + round(at * 1e6) * 1000)
            if len(event) == 1:
                flown.arrivals.append((at, int(event[0] * 1e3) * 1e-3))
                placed = timeline.place(int(event[0] * 1e3), arrival_ns)
                if world.kind.reboot and at >= CHANGE_S + AWAY_S:
                    flown.heard_again_s = min(flown.heard_again_s, at)
                if isinstance(placed, Restarted):
                    clock.reset()
                    published, unanswered, ask_s = PublishedFilter(), 0, t
                    placed = placed.boot_ns
                elif isinstance(placed, Skipped):
                    clock.skip()
                    placed = placed.boot_ns
                if isinstance(placed, int):
                    good += kind.answered_until_s < 0.0
                    if clock.on_arrival(placed, arrival_ns):
                        ask_s = min(ask_s, t)
            else:
                sent, stamp, received, request_s = event
                unanswered = 0
                aligned = timeline.align(round(stamp * 1e9), arrival_ns)
                if not isinstance(aligned, int):
                    continue
                good += world.sent > kind.first_bad
                found = clock.on_exchange(
                    ClockExchange(
                        HostNs(HOST_NS + round(sent * 1e6) * 1000),
                        arrival_ns,
                        BootNs(aligned),
                        request_ns=round(request_s * 1e9),
                    )
                )
                flown.news += [] if found is None else [found]
                published.add(sent, stamp, received)
                if clock.in_doubt:
                    ask_s = min(ask_s, sent + 0.1)
            if good == 3 and flown.three_good_s == inf:
                flown.three_good_s = t
        if round(t / PROBE_S) * PROBE_S == round(t, 6) or abs(t / PROBE_S - round(t / PROBE_S)) < 1e-6:
            _probe(flown, clock, published, t)
    return flown


def _probe(flown: Flown, clock: Clock, published: PublishedFilter, t: float) -> None:
    now = HostNs(HOST_NS + round(t * 1e6) * 1000)
    estimate = clock.estimate(now)
    true_s = t - flown.world.boot(t)
    error = inf if estimate.sigma_s == inf else (estimate.host_from_autopilot_ns - HOST_NS) * 1e-9 - true_s
    bare = sqrt(max(0.0, estimate.sigma_s**2 - estimate.asymmetry_s**2)) if error < inf else inf
    flown.probes.append((t, error, estimate.sigma_s, bare, published.offset - true_s if published.count else inf))


def of_kind(name: str, **changed: object) -> Kind:
    return replace(KINDS[name], **changed)  # type: ignore[arg-type]
