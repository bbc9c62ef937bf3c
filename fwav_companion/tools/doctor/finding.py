"""A finding: what is wrong, how much it matters, and what to change."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from enum import StrEnum

import msgspec


class Level(StrEnum):
    """Severity of a finding, the worst first."""

    ERROR = "ERROR"
    """The service does not do its work: `check` ends with exit status 1."""
    WARNING = "WARNING"
    """The service works, less accurately or less reliably than it could."""
    NOTE = "NOTE"
    """The service works; the user should know this."""


ORDER = tuple(Level)


class Finding(msgspec.Struct, frozen=True):
    """One entry of the report."""

    code: str
    """Stable name for scripts and tests: the kind of fault, without its place."""
    level: Level
    where: str
    """The link, file, key or part concerned."""
    problem: str
    fix: str
    """What to change, in a form that can be copied."""
    consequences: tuple[Finding, ...] = ()
    """Findings that follow from this one and end with it."""

    def walk(self) -> Iterator[Finding]:
        """Yield the finding, then its consequences, depth first."""
        yield self
        for consequence in self.consequences:
            yield from consequence.walk()


def worst(findings: Iterable[Finding]) -> Level:
    """Return the most severe level of the findings; NOTE for none."""
    return min((finding.level for finding in findings), key=ORDER.index, default=Level.NOTE)


def by_level(findings: Iterable[Finding]) -> list[Finding]:
    """Return the findings sorted by level; within a level their order, from the wire to the target, is kept."""
    return sorted(findings, key=lambda finding: ORDER.index(finding.level))


def access_case(group: str) -> str:
    """Return the case of a device that a user may not open: membership in root's group would permit too much."""
    return "root_group" if group in ("", "root") else "own_group"
