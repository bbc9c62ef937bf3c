"""Checks the times in recordings and logs: finds plausible samples, and the part that is one flight on one clock. PURE.

Autopilots' logs have no checksums, so a flipped bit can move a sample by days. A recorder's wall clock may be set while
it records (a board without a clock of its own, when it reaches the network). A replay runs through every second between
two instants, so both errors must be found first. The service's own recordings have one clock throughout.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Final

import msgspec

from fwav_companion.recording.tlog import SkippedBytes, TlogRecord

NEIGHBOURS: Final = 3
"""Number of compared neighbours on either side: a single damaged one is outvoted."""
DISORDER_US: Final = 1_000_000
"""Tolerated disorder of samples in a file: the queues of a logger delay them by some tenths of a second."""
LONGEST_LOG_US: Final = 7 * 24 * 3600 * 1_000_000
"""Distance from the median time of a log beyond which a time is damage, even if it agrees with its neighbours."""
LONGEST_SILENCE_US: Final = 3600 * 1_000_000
"""Longest time without a message within a flight. After a longer one, another flight begins, or the clock was set
forward."""
LARGEST_STEP_BACK_US: Final = 2 * 1_000_000
"""Largest step back of a clock that was not set. After such a step, time is held until the clock has passed it
again."""


def timely(times_us: Sequence[int]) -> list[int]:
    """Indices of the plausible samples of one kind, sorted by time; ``times_us`` is in file order.

    A time before boot is damage.
    """
    if not times_us:
        return []
    middle = sorted(times_us)[len(times_us) // 2]
    damaged = contradicted(times_us)
    plausible = [
        index
        for index, at_us in enumerate(times_us)
        if index not in damaged and at_us >= 0 and abs(at_us - middle) <= LONGEST_LOG_US
    ]
    return sorted(plausible, key=times_us.__getitem__)


def contradicted(times_us: Sequence[int]) -> set[int]:
    """Indices of the times that their neighbours in the file contradict."""
    if all(after - before >= -DISORDER_US for before, after in pairwise(times_us)):
        return set()  # nearly every file
    return {index for index in range(len(times_us)) if not _is_between_neighbours(times_us, index)}


def _is_between_neighbours(times_us: Sequence[int], index: int) -> bool:
    """Whether a time is not before its predecessors and not after its successors. Fewer than two on a side are
    ignored.
    """
    at_us, before = times_us[index], sorted(times_us[max(0, index - NEIGHBOURS) : index])
    after = sorted(times_us[index + 1 : index + 1 + NEIGHBOURS])
    is_early = len(before) > 1 and at_us < before[(len(before) - 1) // 2] - DISORDER_US
    is_late = len(after) > 1 and at_us > after[len(after) // 2] + DISORDER_US
    return not (is_early or is_late)


def on_one_clock(
    items: Iterable[TlogRecord | SkippedBytes],
) -> tuple[list[TlogRecord], list[SkippedBytes], list[str]]:
    """The records of the longest flight in a file with plausible times, the damaged stretches, and notes on the rest.

    The notes name the parts that were left out, by file offset.
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
    """The times in file order. Each one that its neighbours contradict is replaced by the previous time."""
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
