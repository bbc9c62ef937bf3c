"""Which of a log's samples can be believed to be of the time that they tell. Pure.

Autopilots' logs have no checksums: a flipped bit makes a sample of another day. They are written in nearly the order of
their times, so a time that its neighbours in the file contradict is damage.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

NEIGHBOURS: Final = 3
"""On either side: one damaged among them is outvoted."""
DISORDER_US: Final = 1_000_000
"""Queues of a logger put samples into the file by some tenths of a second late."""
LONGEST_LOG_US: Final = 7 * 24 * 3600 * 1_000_000
"""A time further from the middle of a log is damage, whatever its neighbours say."""


def timely(times_us: Sequence[int]) -> list[int]:
    """The indices of the believable samples of one kind, given in file order, by their times."""
    if not times_us:
        return []
    middle = sorted(times_us)[len(times_us) // 2]
    damaged = contradicted(times_us)
    believed = [
        index for index, at_us in enumerate(times_us) if index not in damaged and abs(at_us - middle) <= LONGEST_LOG_US
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
