"""Text of a configuration error: the key as written in the file, its value, the accepted values, the nearest key."""

from __future__ import annotations

import re
import types
import typing
from difflib import get_close_matches
from typing import Any

import msgspec
from msgspec import inspect

LONGEST_VALUE = 80
"""Most characters of a wrong value that are shown, so that the line stays readable."""

KeyPath = tuple[str | int, ...]
"""Path from the file's root: names of tables and keys, indices of lists."""
Complaint = tuple[KeyPath, str]
"""The path of a key, and what is wrong with its value."""


def key_and_value(tree: dict[str, Any], path: KeyPath) -> str:
    """The key and its value: ``[camera.mount] roll_deg = "x"``, ``[[link]] 2 "ground" url = "x"``."""
    if len(path) == 1:
        name = printable(str(path[0]))
        return f"[{name}]" if isinstance(tree.get(str(path[0])), dict) else f"{name}{_value(tree, path)}"
    if len(path) > 1 and isinstance(path[1], int):
        heading, keys = f"[[{path[0]}]] {path[1] + 1}{_link_name(tree[str(path[0])][path[1]])}", path[2:]
    else:
        heading, keys = _heading(tree, path)
    key = "".join(f"[{part}]" if isinstance(part, int) else f" {printable(part)}" for part in keys)
    return f"{heading}{key}{_value(tree, path)}" if keys else heading


def shortened(value: object) -> str:
    """The value roughly as TOML writes it, on one line."""
    if isinstance(value, str):
        shown = f'"{printable(value)}"'
    elif isinstance(value, bool):
        shown = str(value).lower()
    else:
        shown = " ".join(repr(value).split())
    return shown if len(shown) <= LONGEST_VALUE else f"{shown[: LONGEST_VALUE - 3]}..."


def printable(text: str) -> str:
    """The text with "?" for each character that would break its line."""
    return "".join(c if c.isprintable() else "?" for c in text)


def accepted_text(hint: Any) -> str:
    """Accepted values of a declared type: ``a number from 0 to 1``, ``"auto" | "none"``, ``a list, each element a
    text``.
    """
    return _accepted(inspect.type_info(hint))


def spelling_hint(value: object, hint: Any) -> str:
    """Explanation of a misspelt text that the key does not accept, such as a number in quotes; "" without a guess."""
    accepted = accepted_text(hint)
    if not isinstance(value, str) or value == "":
        return ""
    if value.lower() in ("true", "false") and "true | false" in accepted:
        return f"write {value.lower()} in lower case, without quotes"
    if "number" in accepted or "integer" in accepted:
        number = value.replace(",", ".")
        if re.fullmatch(r"[-+]?[0-9]+(\.[0-9]+)?", number):
            comma = " with a decimal point" if "," in value else ""
            return f"write {number}{comma}, without quotes"
    return ""


def hints_of(form: type[msgspec.Struct]) -> dict[str, Any]:
    """The declared type of each key of a table, with its limits."""
    return typing.get_type_hints(form, include_extras=True)


def table_of(hint: Any) -> type[msgspec.Struct] | None:
    """The table in the type ``Table``, ``Table | None`` or ``tuple[Table, ...]``; None for another type."""
    if isinstance(hint, type) and issubclass(hint, msgspec.Struct):
        return hint
    if typing.get_origin(hint) in (tuple, types.UnionType):
        return table_of(typing.get_args(hint)[0])
    return None


def unknown_key(key: str, form: type[msgspec.Struct], document: type[msgspec.Struct]) -> str:
    """Text of the error of an unknown key. It names the nearest key of this table, else the table that has the key,
    else all keys of this table.
    """
    hints = hints_of(form)
    near = get_close_matches(key, hints, n=1)
    if near:
        return f'unknown key; did you mean "{near[0]}"?'
    elsewhere = [heading for heading, names in _keys_by_heading(document).items() if key in names]
    if elsewhere:
        return f"unknown key here; did you mean it in {elsewhere[0]}?"
    kind = "tables" if form is document else "keys"
    return f"unknown key; accepted {kind}: {', '.join(hints)}"


def _heading(tree: dict[str, Any], path: KeyPath) -> tuple[str, KeyPath]:
    """The tables that lead to the key as a heading, and the rest of the path."""
    tables: list[str] = []
    node: Any = tree
    for part in path[:-1]:
        if isinstance(part, str) and isinstance(node.get(part, {}), dict):
            tables.append(part)
            node = node.get(part, {})
        else:
            break
    return f"[{'.'.join(tables)}]", path[len(tables) :]


def _link_name(link: object) -> str:
    name = link.get("name") if isinstance(link, dict) else None
    return f" {shortened(name)}" if isinstance(name, str) else ""


def _value(tree: Any, path: KeyPath) -> str:
    """`` = VALUE`` of the key; "" where it is missing."""
    for part in path:
        try:
            tree = tree[part]
        except (KeyError, IndexError, TypeError):
            return ""
    return f" = {shortened(tree)}"


def _accepted(kind: inspect.Type) -> str:
    match kind:
        case inspect.Metadata(type=inner, extra_json_schema=schema):
            return str((schema or {}).get("description", _accepted(inner)))
        case inspect.LiteralType(values=values):
            return " | ".join(f'"{value}"' for value in values)
        case inspect.UnionType(types=types):
            return " | ".join(_accepted(member) for member in types if not isinstance(member, inspect.NoneType))
        case inspect.FloatType() | inspect.IntType():
            return _accepted_number(kind)
        case inspect.BoolType():
            return "true | false"
        case inspect.StrType(min_length=shortest, max_length=longest):
            length = f" of {shortest} to {longest} characters" if longest else ""
            return f"a {'non-empty ' if shortest and not longest else ''}text{length}"
        case inspect.TupleType(item_types=items):
            return f"a list of {len(items)}: each {_accepted(items[0])}"
        case inspect.VarTupleType(item_type=item):
            return f"a list, each element {_accepted(item)}"
        case inspect.DictType(key_type=key, value_type=value):
            return f"a table, each key {_accepted(key)}, each value {_accepted(value)}"
        case _:
            return "a table"


def _accepted_number(kind: inspect.FloatType | inspect.IntType) -> str:
    noun = "an integer" if isinstance(kind, inspect.IntType) else "a number"
    if kind.ge is not None and kind.le is not None:
        return f"{noun} from {kind.ge:g} to {kind.le:g}"
    low = f"above {kind.gt:g}" if kind.gt is not None else f"{kind.ge:g} or more" if kind.ge is not None else ""
    high = f"at most {kind.le:g}" if kind.le is not None else ""
    limits = " and ".join(part for part in (low, high) if part)
    return f"{noun}, {limits}" if limits else noun


def _keys_by_heading(document: type[msgspec.Struct]) -> dict[str, tuple[str, ...]]:
    """The keys of every table, by the table's heading in the file."""
    keys: dict[str, tuple[str, ...]] = {}

    def collect(form: type[msgspec.Struct], heading: str) -> None:
        for name, hint in hints_of(form).items():
            table = table_of(hint)
            if table is not None:
                inner = f"{heading}.{name}" if heading else name
                shown = f"[[{inner}]]" if typing.get_origin(hint) is tuple else f"[{inner}]"
                keys[shown] = table.__struct_fields__
                collect(table, inner)

    collect(document, "")
    return keys
