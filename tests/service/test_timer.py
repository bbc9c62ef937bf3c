"""The timer that wakes the daemon, with a loop in invented time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import pytest

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.service.timer import FALLBACK_INTERVAL_NS, STEADY_NS, PipelineTimer

START_NS = HostNs(1_000 * NS_PER_S)


class Handle:
    def __init__(self, when_s: float, ring: Callable[[], None]) -> None:
        self.when_ns, self.ring, self.cancelled = round(when_s * NS_PER_S), ring, False

    def cancel(self) -> None:
        self.cancelled = True


class Daemon:
    """Has work at every whole interval; does it when a message or its timer wakes it."""

    def __init__(self, interval_ns: int) -> None:
        self.interval_ns = interval_ns
        self.due = HostNs(START_NS + interval_ns)
        self.now = START_NS
        self.alarm = PipelineTimer(self.on_alarm, self.call_at)
        self.handles: list[Handle] = []
        self.rings = 0
        self.done: list[tuple[int, int]] = []
        """(when it was due, when it was done)."""
        self.alarm.arm(self.now, self.due)

    def call_at(self, when_s: float, ring: Callable[[], None]) -> Handle:
        self.handles.append(Handle(when_s, ring))
        return self.handles[-1]

    def on_alarm(self) -> None:
        self.rings += 1
        if not self.alarm.is_early(self.now, self.due):
            self.do_due()
        self.alarm.arm(self.now, self.due)

    def on_message(self) -> None:
        self.alarm.heard(self.now)
        self.do_due()
        self.alarm.arm(self.now, self.due)

    def do_due(self) -> None:
        while self.due <= self.now:
            self.done.append((self.due - START_NS, self.now - START_NS))
            self.due = HostNs(self.due + self.interval_ns)

    def run(self, until_s: float, messages_ms: Sequence[int] = ()) -> None:
        """Process messages and timer events in order of time."""
        messages = [START_NS + ms * NS_PER_MS for ms in messages_ms]
        until_ns = START_NS + round(until_s * NS_PER_S)
        while True:
            live = [handle for handle in self.handles if not handle.cancelled]
            assert len(live) <= 1, "one timer at a time"
            ring_ns = live[0].when_ns if live else until_ns + 1
            if messages and messages[0] <= ring_ns:
                self.now = HostNs(messages.pop(0))
                self.on_message()
            elif ring_ns <= until_ns:
                self.now = HostNs(ring_ns)
                self.handles.remove(live[0])
                live[0].ring()
            else:
                return


def late_ns(daemon: Daemon) -> list[int]:
    return [done - due for due, done in daemon.done]


def test_where_nothing_comes_all_is_done_when_it_is_due():
    daemon = Daemon(33 * NS_PER_MS)
    daemon.run(1.0)
    assert [due for due, _ in daemon.done] == [33 * NS_PER_MS * k for k in range(1, 31)]
    assert set(late_ns(daemon)) == {0}


def test_a_slow_stream_makes_nothing_late():
    """Four messages a second, as an autopilot sends that refused every rate."""
    daemon = Daemon(33 * NS_PER_MS)
    daemon.run(2.0, range(0, 2000, 250))
    assert set(late_ns(daemon)) == {0}


def test_bursts_make_nothing_late():
    """Ten times a second an autopilot sends six messages one after another, and then nothing."""
    daemon = Daemon(33 * NS_PER_MS)
    daemon.run(2.0, [at_ms + message_ms for at_ms in range(0, 2000, 100) for message_ms in range(0, 18, 3)])
    assert set(late_ns(daemon)) == {0}


def test_a_busy_stream_does_what_is_due_and_the_alarm_hardly_rings():
    daemon = Daemon(33 * NS_PER_MS)
    daemon.run(10.0, range(0, 10_001, 10))
    assert len(daemon.done) == 303
    assert max(late_ns(daemon)) < 10 * NS_PER_MS
    assert daemon.rings <= 10 * NS_PER_S / FALLBACK_INTERVAL_NS + STEADY_NS / daemon.interval_ns + 1


def test_when_a_busy_stream_ends_at_once_one_thing_is_late_and_no_more():
    daemon = Daemon(33 * NS_PER_MS)
    daemon.run(3.0, range(0, 1001, 10))
    after = [(due, done) for due, done in daemon.done if due > NS_PER_S]
    assert after[0][1] - NS_PER_S <= FALLBACK_INTERVAL_NS + 20 * NS_PER_MS
    punctual = [(due, done) for due, done in after if done > after[0][1]]
    assert len(punctual) > 50
    assert all(due == done for due, done in punctual)
    assert all(b - a == daemon.interval_ns for (a, _), (b, _) in pairwise(daemon.done)), "nothing is left out"


def test_the_timer_rings_amid_a_busy_stream_for_work_that_no_message_triggers():
    rang: list[int] = []
    daemon = Daemon(NS_PER_S)
    alarm = PipelineTimer(lambda: rang.append(daemon.now), daemon.call_at)
    daemon.handles.clear()
    strict = HostNs(START_NS + 250 * NS_PER_MS)
    for ms in range(0, 201, 10):
        daemon.now = HostNs(START_NS + ms * NS_PER_MS)
        alarm.heard(daemon.now)
        alarm.arm(daemon.now, daemon.due, strict if ms == 200 else None)
    (handle,) = [handle for handle in daemon.handles if not handle.cancelled]
    assert handle.when_ns == pytest.approx(strict, abs=1000)


def test_with_nothing_due_nothing_rings():
    daemon = Daemon(NS_PER_S)
    daemon.handles.clear()
    PipelineTimer(daemon.on_alarm, daemon.call_at).arm(START_NS, None)
    assert daemon.handles == []
