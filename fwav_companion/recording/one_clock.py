"""Which part of a recording is one flight on one clock. Pure.

A recorder's wall clock may be set while it records (a board without a clock of its own, when it finds the network), and
a flipped bit makes an instant of another year; a replay runs through every second between two instants. Our own
recordings have one clock throughout.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Final

import msgspec

from fwav_companion.recording.timely import contradicted
from fwav_companion.recording.tlog import SkippedBytes, TlogRecord

LONGEST_SILENCE_US: Final = 3600 * 1_000_000
"""Without one message: beyond, it is another flight, or the clock was set forward."""
LARGEST_STEP_BACK_US: Final = 2 * 1_000_000
"""Beyond, the clock was set back. Behind a smaller step, time stands until the clock has come there again."""


def on_one_clock(
    items: Iterable[TlogRecord | SkippedBytes],
) -> tuple[list[TlogRecord], list[SkippedBytes], list[str]]:
    """The records of the longest flight in a file, with instants that can be believed; damage; what was left out."""
    records: list[TlogRecord] = []
    skipped: list[SkippedBytes] = []
    offsets, at = [0], 0
    for item in items:
        if isinstance(item, SkippedBytes):
            skipped.append(item)
            at += item.length
        else:
            records.append(item)
            at += item.bytes_in_file
            offsets.append(at)
    times_us = settled([record.unix_us for record in records])
    start, end = longest_stretch(times_us)
    notes = [
        f"the clock was set, or nothing came for an hour, at offset {offsets[edge]}: what stands {where} is left out"
        for edge, where, cut in ((start, "before", start > 0), (end, "behind", end < len(records)))
        if cut
    ]
    kept = zip(records[start:end], times_us[start:end], strict=True)
    return [msgspec.structs.replace(record, unix_us=unix_us) for record, unix_us in kept], skipped, notes


def settled(times_us: Sequence[int]) -> list[int]:
    """In file order, an instant that its neighbours contradict replaced by the one before it."""
    instants = list(times_us)
    for index in sorted(contradicted(times_us)):
        instants[index] = instants[index - 1] if index else times_us[1]
    return instants


def longest_stretch(times_us: Sequence[int]) -> tuple[int, int]:
    """(start, end) of the longest run, by its messages, in which the clock is not set."""
    breaks = [
        index
        for index, (before, after) in enumerate(pairwise(times_us), start=1)
        if not -LARGEST_STEP_BACK_US <= after - before <= LONGEST_SILENCE_US
    ]
    return max(pairwise([0, *breaks, len(times_us)]), key=lambda run: run[1] - run[0])
