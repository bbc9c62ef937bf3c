"""Which findings follow from which: a root cause lists its consequences, so that the user repairs one thing.

The tables of findings and reasons hold them, without a cycle. Findings of one link explain only those of the same link,
and those of the vehicle where no other link brings its autopilot.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import msgspec

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding, Level, by_level, worst
from fwav_companion.tools.doctor.finding_table import FINDINGS, GROUPS, consequences_of
from fwav_companion.tools.reason_table import REASONS

OF_MOUNTS: Final = consequences_of("", GROUPS["mount"])
"""Findings that, as an ERROR, are caused by the mount, however slow attitudes are."""
_NAMES: Final = {reason.value: entry.consequences for reason, entry in REASONS.items()} | {
    code: entry.consequences for code, entry in FINDINGS.items()
}
CAUSES: Final[Mapping[str, frozenset[str]]] = {
    code: consequences_of(code, names) for code, names in _NAMES.items() if names
}
"""Codes of the consequences of each finding, by its code."""


def nested(findings: Sequence[Finding], evidence: Evidence) -> list[Finding]:
    """Return the root findings, the worst first, each with its consequences; a root is as severe as they are."""
    cause_of = [_cause(effect, findings, evidence) for effect in findings]

    def with_consequences(index: int) -> Finding:
        own = findings[index]
        effects = by_level(with_consequences(k) for k, cause in enumerate(cause_of) if cause == index)
        return msgspec.structs.replace(own, level=worst([own, *effects]), consequences=tuple(effects))

    return by_level(with_consequences(index) for index, cause in enumerate(cause_of) if cause is None)


def _cause(effect: Finding, findings: Sequence[Finding], evidence: Evidence) -> int | None:
    """Return the index of the first finding that explains another; None for a root."""
    for index, cause in enumerate(findings):
        if effect.code in CAUSES.get(cause.code, ()) and _reaches(cause, effect, evidence):
            return index
    return None


def _reaches(cause: Finding, effect: Finding, evidence: Evidence) -> bool:
    if effect.code in OF_MOUNTS and effect.level is Level.ERROR:
        return cause.code in OF_MOUNTS or cause.code == "mount_in_radians"
    if not cause.where.startswith("link "):
        return True
    if effect.where.startswith("link "):
        return effect.where == cause.where
    return cause.where == _only_way(evidence)


def _only_way(evidence: Evidence) -> str:
    """Return the link that the autopilot is heard on, or the only one that it could be heard on; "" if neither is."""
    autopilot = evidence.status.autopilot if evidence.status is not None else None
    if autopilot is not None and autopilot.link:
        return f"link {autopilot.link}"
    ways = [link.name for link in evidence.config.link if link.role == "autopilot"]
    return f"link {ways[0]}" if len(ways) == 1 else ""
