"""Checks the times in recordings and logs: believable samples, and the part that is one flight on one clock. PURE.

Autopilots' logs have no checksums, so that a flipped bit gives a sample another day. A recorder's wall clock may be set
while it records (a board without a clock of its own, when it reaches the network). A replay runs through every second
between two instants, so both must be found first. Our own recordings have one clock throughout.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Final

import msgspec

from fwav_companion.recording.tlog import SkippedBytes, TlogRecord

NEIGHBOURS: Final = 3
"""Number on either side: a single damaged one is outvoted."""
DISORDER_US: Final = 1_000_000
"""The queues of a logger delay samples in the file by some tenths of a second."""
LONGEST_LOG_US: Final = 7 * 24 * 3600 * 1_000_000
"""A time further from the median of a log is damage, whatever its neighbours say."""
LONGEST_SILENCE_US: Final = 3600 * 1_000_000
"""After a longer time without a message, another flight begins, or the clock was set forward."""
LARGEST_STEP_BACK_US: Final = 2 * 1_000_000
"""A larger step back means that the clock was set. After a smaller one, time stands still until the clock has passed
it again."""


def timely(times_us: Sequence[int]) -> list[int]:
    """Indices of the believable samples of one kind (given in file order), sorted by time.

    A time before boot is damage.
    """
    if not times_us:
        return []
    middle = sorted(times_us)[len(times_us) // 2]
    damaged = contradicted(times_us)
    believed = [
        index
        for index, at_us in enumerate(times_us)
        if index not in damaged and at_us >= 0 and abs(at_us - middle) <= LONGEST_LOG_US
    ]
    return sorted(believed, key=times_us.__getitem__)


def contradicted(times_us: Sequence[int]) -> set[int]:
    """The indices of those, in file order, whose neighbours were written at quite another time."""
    if all(after - before >= -DISORDER_US for before, after in pairwise(times_us)):
        return set()  # nearly every file
    return {index for index in range(len(times_us)) if not _is_between_neighbours(times_us, index)}


def _is_between_neighbours(times_us: Sequence[int], index: int) -> bool:
    """Not before those that precede it nor after those that follow. Fewer than two on a side prove nothing."""
    at_us, before = times_us[index], sorted(times_us[max(0, index - NEIGHBOURS) : index])
    after = sorted(times_us[index + 1 : index + 1 + NEIGHBOURS])
    is_early = len(before) > 1 and at_us < before[(len(before) - 1) // 2] - DISORDER_US
    is_late = len(after) > 1 and at_us > after[len(after) // 2] + DISORDER_US
    return not (is_early or is_late)


def on_one_clock(
    items: Iterable[TlogRecord | SkippedBytes],
) -> tuple[list[TlogRecord], list[SkippedBytes], list[str]]:
    """The records of the longest flight in a file with believable times, the damaged stretches, and notes on the rest.

    The notes say, by file offset, what was left out.
    """
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
        f"the clock was set, or no message came for an hour, at offset {offsets[edge]}: everything {where} is left out"
        for edge, where, cut in ((start, "before", start > 0), (end, "after", end < len(records)))
        if cut
    ]
    kept = zip(records[start:end], times_us[start:end], strict=True)
    return [msgspec.structs.replace(record, unix_us=unix_us) for record, unix_us in kept], skipped, notes


def settled(times_us: Sequence[int]) -> list[int]:
    """The times in file order, each that its neighbours contradict replaced by the one before."""
    instants = list(times_us)
    for index in sorted(contradicted(times_us)):
        instants[index] = instants[index - 1] if index else times_us[1]
    return instants


def longest_stretch(times_us: Sequence[int]) -> tuple[int, int]:
    """(start, end) of the run with the most messages in which the clock was not set."""
    breaks = [
        index
        for index, (before, after) in enumerate(pairwise(times_us), start=1)
        if not -LARGEST_STEP_BACK_US <= after - before <= LONGEST_SILENCE_US
    ]
    return max(pairwise([0, *breaks, len(times_us)]), key=lambda run: run[1] - run[0])
