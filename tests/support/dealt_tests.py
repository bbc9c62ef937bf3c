"""The order of the tests in which no worker is left alone with a long one."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from typing import TypeVar

Test = TypeVar("Test")


def dealt(long: Sequence[Test], short: Sequence[Test], workers: int) -> list[Test]:
    """All tests, the long ones dealt to the heads of the parts that the workers get.

    xdist's ``worksteal`` gives each worker a contiguous part of the list, ``left // (workers that have none yet)``
    tests, and moves the ends of these parts to workers that are done. A long test at such an end begins when all others
    are over, and one core waits for it.
    """
    rest, tests = iter(short), list[Test]()
    for part in range(workers):
        head = long[part::workers]
        size = (len(long) + len(short) - len(tests)) // (workers - part)
        tests += [*head, *islice(rest, max(0, size - len(head)))]
    return tests
