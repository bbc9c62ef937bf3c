"""Clocks are frames too: an instant carries its clock in its type, in whole nanoseconds.

    host = boot + host_from_autopilot

Integers keep differences exact wherever an epoch lies, so a recording replays to the same bits on any clock base.
Instants that enter from outside are rounded to whole microseconds at the door, as a recording stores them.
"""

from __future__ import annotations

from typing import NewType

HostNs = NewType("HostNs", int)
"""The host's never-stepped clock (CLOCK_MONOTONIC, or the recording's ``time_unix``)."""

BootNs = NewType("BootNs", int)
"""The autopilot's clock: time since its boot, unwrapped past 49.7 days."""

NS_PER_S = 1_000_000_000
NS_PER_MS = 1_000_000
NS_PER_US = 1_000


def ns_from_s(seconds: float) -> int:
    """A duration in nanoseconds, rounded."""
    return round(seconds * 1e9)


def s_from_ns(duration_ns: int) -> float:
    """A duration in seconds."""
    return duration_ns * 1e-9


def host_from_seconds(seconds: float) -> HostNs:
    """An instant told in float seconds, to whole microseconds: a float near 1.8e9 resolves no more than 0.24 us."""
    return HostNs(round(seconds * 1e6) * NS_PER_US)


def whole_microseconds(instant: int) -> HostNs:
    """A host instant cut to the microseconds that a recording keeps."""
    return HostNs(instant // NS_PER_US * NS_PER_US)
