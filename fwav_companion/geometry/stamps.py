"""Instants in whole nanoseconds: the type of an instant names its clock, as the name of a vector names its frame.

    host = boot + host_from_autopilot

Integers keep differences exact whatever the epoch, so a recording replays to the same bits on any clock base. Instants
that enter from outside are rounded to whole microseconds at once, because a recording stores no more.
"""

from __future__ import annotations

from typing import NewType

HostNs = NewType("HostNs", int)
"""Instant of the host clock, which is never stepped: CLOCK_MONOTONIC, or the recording's ``time_unix``."""

BootNs = NewType("BootNs", int)
"""Instant of the autopilot clock: time since its boot, unwrapped past 49.7 days."""

NS_PER_S = 1_000_000_000
NS_PER_MS = 1_000_000
NS_PER_US = 1_000


def ns_from_s(seconds: float) -> int:
    """The duration ``seconds`` in nanoseconds, rounded."""
    return round(seconds * 1e9)


def s_from_ns(duration_ns: int) -> float:
    """The duration ``duration_ns`` in seconds."""
    return duration_ns * 1e-9


def host_from_seconds(seconds: float) -> HostNs:
    """The host instant of a float number of seconds, rounded to 1 us: a float near 1.8e9 resolves 0.24 us."""
    return HostNs(round(seconds * 1e6) * NS_PER_US)


def whole_microseconds(instant: int) -> HostNs:
    """The host instant truncated to whole microseconds, which is what a recording keeps."""
    return HostNs(instant // NS_PER_US * NS_PER_US)
