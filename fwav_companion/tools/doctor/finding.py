"""One thing that is wrong, how much it matters, and what to do about it."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum

import msgspec


class Level(StrEnum):
    """How much it matters, the worst first."""

    STOPS = "stops"
    """The service cannot do its work: no fix can come of this."""
    HARMS = "harms"
    """It works, and is worse or less sure than it could be."""
    MINDS = "minds"
    """It works; something is worth knowing."""


ORDER = tuple(Level)


class Finding(msgspec.Struct, frozen=True):
    """One line of the doctor's."""

    code: str
    """Its name, for scripts and tests: what is wrong, never where."""
    level: Level
    where: str
    """The link, file, key or thing that it is about."""
    what: str
    do: str
    """What to change, so that it can be copied."""


def in_order(findings: Iterable[Finding]) -> list[Finding]:
    """By importance; within a level as they were found, which is from the wire to the target."""
    return sorted(findings, key=lambda finding: ORDER.index(finding.level))
