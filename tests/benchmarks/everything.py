"""All benchmarks in the order of the design's table: what ``fwav-companion bench`` runs.

``python -m tests.benchmarks.everything``
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib import import_module

from tests.benchmarks.figure import Figure

BENCHMARKS = (
    "decode",
    "corruption",
    "adversary",
    "encode",
    "relay",
    "lens",
    "fix",
    "attitude_at",
    "filter_update",
    "ten_targets",
    "calls",
    "startup",
    "daemon",
    "solving",
    "detection",
    "tiles",
    "patch",
    "camera",
    "study",
    "study_report",
    "export",
    "locate",
    "fusion",
)
"""Modules of this package, each with ``measure() -> list[Figure]``."""


def benchmarks(names: Sequence[str] = BENCHMARKS) -> Iterator[tuple[str, Callable[[], list[Figure]]]]:
    """Each benchmark with its name; a module is imported when its turn comes, so its libraries do not affect earlier
    ones.
    """
    for name in names:
        yield name, import_module(f"tests.benchmarks.{name}").measure


if __name__ == "__main__":
    for _, measure in benchmarks():
        print(*measure(), sep="\n", flush=True)
