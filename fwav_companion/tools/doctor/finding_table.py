"""The table of findings, ``findings.toml``: makes a finding of its code and the values; also what follows from what."""

from __future__ import annotations

import tomllib
from importlib.resources import files
from string import Formatter
from typing import Any, Final, TypeVar

import msgspec

from fwav_companion.tools.doctor.finding import Finding, Level

T = TypeVar("T")
ELSE: Final = "else"
"""The case of a field for all cases that it does not name."""

Template = str | dict[str, str]
"""A text with {names} of values and parts, or one for each case."""


class FindingEntry(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One finding; the head of the file explains the fields."""

    level: Level | dict[str, Level]
    where: Template
    problem: Template
    fix: Template
    parts: dict[str, Template] = {}
    consequences: tuple[str, ...] = ()


def _read() -> tuple[dict[str, FindingEntry], dict[str, Template], dict[str, tuple[str, ...]]]:
    tables = tomllib.loads(files(__package__).joinpath("findings.toml").read_text(encoding="utf-8"))
    groups = msgspec.convert(tables.pop("groups"), dict[str, tuple[str, ...]])
    shared = msgspec.convert(tables.pop("shared"), dict[str, Template])
    return msgspec.convert(tables, dict[str, FindingEntry]), shared, groups


FINDINGS, SHARED_PARTS, GROUPS = _read()
"""Every finding by its code, the parts that several use, and sets of findings by name."""


def make_finding(code: str, *cases: str, **values: Any) -> Finding:
    """Return the finding of a code: its texts filled with the values, each field by that of the cases that it names.

    A part of which a value is None is left out. Raises KeyError for a code, a case or a value that is missing.
    """
    entry = FINDINGS[code]
    parts = SHARED_PARTS | entry.parts

    def text(template: Template) -> str:
        chosen = _chosen(template, cases)
        names = names_in(chosen)
        texts = {name: part(parts[name]) if name in parts else values[name] for name in names}
        return chosen.format_map(texts)

    def part(template: Template) -> str:
        names = names_in(_chosen(template, cases))
        return "" if any(values[name] is None for name in names if name not in parts) else text(template)

    return Finding(
        code, _chosen(entry.level, cases), text(entry.where), problem=text(entry.problem), fix=text(entry.fix)
    )


def consequences_of(code: str, names: tuple[str, ...]) -> frozenset[str]:
    """Return the codes behind the names of findings and groups, without the finding's own code."""
    codes = (consequences_of(code, GROUPS[name]) if name in GROUPS else {name} for name in names)
    return frozenset().union(*codes) - {code}


def names_in(template: str) -> set[str]:
    """Return the names of the values and parts in a text."""
    return {name for _, name, _, _ in Formatter().parse(template) if name is not None}


def _chosen(field: T | dict[str, T], cases: tuple[str, ...]) -> T:
    """Return the field itself, or what it has for one of the cases."""
    if not isinstance(field, dict):
        return field
    return field[next((case for case in cases if case in field), ELSE)]
