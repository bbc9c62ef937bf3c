"""What tables and keys there are, read off the sections' own types."""

from __future__ import annotations

import types
import typing
from difflib import get_close_matches
from typing import Any

from fwav_companion.config.document import Document
from fwav_companion.config.inputs import Section


def hints_of(form: type[Section]) -> dict[str, Any]:
    """The declared type of each key of a section, with its limits."""
    return typing.get_type_hints(form, include_extras=True)


def section_of(hint: Any) -> type[Section] | None:
    """The section behind ``Section``, ``Section | None`` or ``tuple[Section, ...]``."""
    if isinstance(hint, type) and issubclass(hint, Section):
        return hint
    if typing.get_origin(hint) in (tuple, types.UnionType):
        return section_of(typing.get_args(hint)[0])
    return None


def unknown_key(key: str, form: type[Section]) -> str:
    """The nearest known key: here, else of the same name elsewhere, else all that are known here."""
    hints = hints_of(form)
    near = get_close_matches(key, hints, n=1)
    if near:
        return f'unknown key; did you mean "{near[0]}"?'
    elsewhere = [where for where, names in _known_keys().items() if key in names]
    if elsewhere:
        return f"unknown key here; did you mean it in {elsewhere[0]}?"
    kind = "tables" if form is Document else "keys"
    return f"unknown key; accepted {kind}: {', '.join(hints)}"


def _known_keys() -> dict[str, tuple[str, ...]]:
    """The keys of every table, by the table's heading."""
    keys: dict[str, tuple[str, ...]] = {}

    def collect(form: type[Section], heading: str) -> None:
        for name, hint in hints_of(form).items():
            section = section_of(hint)
            if section is not None:
                inner = f"{heading}.{name}" if heading else name
                shown = f"[[{inner}]]" if typing.get_origin(hint) is tuple else f"[{inner}]"
                keys[shown] = section.__struct_fields__
                collect(section, inner)

    collect(Document, "")
    return keys
