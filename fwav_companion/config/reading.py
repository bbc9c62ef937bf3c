"""TOML text to a Config. Every error is one line: file, key, what stood there, what is accepted."""

from __future__ import annotations

import math
import re
import tomllib
import types
import typing
from collections.abc import Iterable, Iterator, Mapping
from difflib import get_close_matches
from typing import Any

import msgspec

from fwav_companion.config.accepted import accepted_text
from fwav_companion.config.document import Config, Document
from fwav_companion.config.inputs import Section
from fwav_companion.config.rules import Complaint, broken_rules
from fwav_companion.errors import ConfigError

Tree = dict[str, Any]
Path = tuple[str | int, ...]

LONGEST_VALUE = 80
"""Characters of a wrong value that are shown: the line must stay one that can be read."""


def parse(text: str, name: str, overrides: Iterable[str] = ()) -> Config:
    """The configuration in ``text`` of the file ``name``, with ``KEY=VALUE`` settings laid over it. ConfigError."""
    tree = _toml(text, name)
    overridden = [_override(tree, setting) for setting in overrides]

    def fail(complaint: Complaint) -> typing.NoReturn:
        path, what = complaint
        by_override = any(path[: len(key)] == key for key in overridden)
        raise ConfigError(f"{'--set' if by_override else name}: {_where(tree, path)}: {what}")

    for complaint in _form_errors(tree, Document, ()):
        fail(complaint)
    document = msgspec.convert(tree, Document)
    for complaint in broken_rules(document):
        fail(complaint)
    return Config(**{field: getattr(document, field) for field in Document.__struct_fields__}, file=name)


def _toml(text: str, name: str) -> Tree:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{name}: {_toml_error(text, str(error))}") from None
    except (RecursionError, ValueError) as error:  # nested without end; a number of thousands of digits
        raise ConfigError(f"{name}: not readable as TOML ({type(error).__name__}); accepted: TOML 1.0") from None


def _toml_error(text: str, message: str) -> str:
    """The parser tells the line by its number; the user wants to see it as well."""
    lines = text.splitlines()
    numbered = re.search(r"at line (\d+)", message)
    if numbered is None or int(numbered[1]) > len(lines):
        return f"{message}; accepted: TOML 1.0"
    line = lines[int(numbered[1]) - 1].strip()
    return f"line {numbered[1]}: {_shortened(line)}: {message}; accepted: TOML 1.0"


def _override(tree: Tree, setting: str) -> Path:
    """Lay ``dotted.key=value`` over the tree; the path it set. A bare word is taken as text, as shells eat quotes."""
    key, separator, value = setting.partition("=")
    path = tuple(key.strip().split("."))
    if not separator or not all(re.fullmatch(r"[A-Za-z0-9_-]+", part) for part in path):
        raise ConfigError(f"--set: {_shortened(setting)}: accepted: KEY=VALUE, as tracking.filter=lowpass")
    table = tree
    for depth, part in enumerate(path[:-1], start=1):
        table = table.setdefault(part, {})
        if not isinstance(table, dict):
            raise ConfigError(
                f"--set: {_shortened(setting)}: {'.'.join(path[:depth])} is no table; accepted: one of its"
            )
    table[path[-1]] = _override_value(value.strip(), setting)
    return path


def _override_value(value: str, setting: str) -> Any:
    try:
        parsed = tomllib.loads(f"value = {value}")
    except (tomllib.TOMLDecodeError, ValueError, RecursionError):
        parsed = {"value": value} if re.fullmatch(r"[A-Za-z0-9_./:\[\]-]+", value) else {}
    if parsed.keys() != {"value"}:
        raise ConfigError(f"--set: {_shortened(setting)}: no TOML value; accepted: KEY=VALUE, as ground.height_m=1.5")
    return parsed["value"]


def _form_errors(tree: object, form: type[Section], path: Path) -> Iterator[Complaint]:
    """What in the tree has not the form of this section, in the tree's order."""
    if not isinstance(tree, dict):
        yield path, "accepted: a table"
        return
    hints = typing.get_type_hints(form, include_extras=True)
    for key, value in tree.items():
        if key not in hints:
            yield (*path, key), _unknown_key(key, form, hints)
        else:
            yield from _value_errors(value, hints[key], (*path, key))
    for field in msgspec.structs.fields(form):
        if field.required and field.name not in tree:
            yield (*path, field.name), f"missing; accepted: {accepted_text(hints[field.name])}"


def _value_errors(value: object, hint: Any, path: Path) -> Iterator[Complaint]:
    section = _section_of(hint)
    if section is None:
        yield from _leaf_errors(value, hint, path)
    elif typing.get_origin(hint) is not tuple:
        yield from _form_errors(value, section, path)
    elif not isinstance(value, list):
        yield path, f"accepted: tables, each headed [[{path[-1]}]]"
    else:
        for index, element in enumerate(value):
            yield from _form_errors(element, section, (*path, index))


def _section_of(hint: Any) -> type[Section] | None:
    """The section behind ``Section``, ``Section | None`` or ``tuple[Section, ...]``."""
    if isinstance(hint, type) and issubclass(hint, Section):
        return hint
    if typing.get_origin(hint) in (tuple, types.UnionType):
        return _section_of(typing.get_args(hint)[0])
    return None


def _leaf_errors(value: object, hint: Any, path: Path) -> Iterator[Complaint]:
    if not _is_finite(value):
        yield path, f"not finite; accepted: {accepted_text(hint)}"
        return
    try:
        msgspec.convert(value, hint)
    except msgspec.ValidationError:
        yield path, f"accepted: {accepted_text(hint)}"


def _is_finite(value: object) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, list):
        return all(map(_is_finite, value))
    return all(map(_is_finite, value.values())) if isinstance(value, dict) else True


def _unknown_key(key: str, form: type[Section], hints: Mapping[str, Any]) -> str:
    """The nearest known key: here, else of the same name elsewhere, else all that are known here."""
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
        for name, hint in typing.get_type_hints(form, include_extras=True).items():
            section = _section_of(hint)
            if section is not None:
                inner = f"{heading}.{name}" if heading else name
                shown = f"[[{inner}]]" if typing.get_origin(hint) is tuple else f"[{inner}]"
                keys[shown] = section.__struct_fields__
                collect(section, inner)

    collect(Document, "")
    return keys


def _where(tree: Tree, path: Path) -> str:
    """``[camera.mount] roll_deg = "x"``, ``[[link]] 2 "ground" url = "x"``: the key, and what stood there."""
    if len(path) == 1:
        return f"{path[0]}{_standing(tree, path)}" if not isinstance(tree.get(str(path[0])), dict) else f"[{path[0]}]"
    if len(path) > 1 and isinstance(path[1], int):
        heading, keys = f"[[{path[0]}]] {path[1] + 1}{_name_of(tree[str(path[0])][path[1]])}", path[2:]
    else:
        heading, keys = _heading(tree, path)
    key = "".join(f"[{part}]" if isinstance(part, int) else f" {part}" for part in keys)
    return f"{heading}{key}{_standing(tree, path)}" if keys else heading


def _heading(tree: Tree, path: Path) -> tuple[str, Path]:
    """The longest run of tables that leads to the key, as a heading, and the rest of the path."""
    tables: list[str] = []
    node: Any = tree
    for part in path[:-1]:
        if isinstance(part, str) and isinstance(node.get(part, {}), dict):
            tables.append(part)
            node = node.get(part, {})
        else:
            break
    return f"[{'.'.join(tables)}]", path[len(tables) :]


def _name_of(link: object) -> str:
    name = link.get("name") if isinstance(link, dict) else None
    return f" {_shortened(name)}" if isinstance(name, str) else ""


def _standing(tree: Any, path: Path) -> str:
    """``= VALUE`` of the key; nothing where it is missing."""
    for part in path:
        try:
            tree = tree[part]
        except (KeyError, IndexError, TypeError):
            return ""
    return f" = {_shortened(tree)}"


def _shortened(value: object) -> str:
    """The value as TOML would write it, roughly, on one line."""
    if isinstance(value, str):
        shown = '"' + "".join(c if c.isprintable() else "?" for c in value) + '"'
    elif isinstance(value, bool):
        shown = str(value).lower()
    else:
        shown = " ".join(repr(value).split())
    return shown if len(shown) <= LONGEST_VALUE else f"{shown[: LONGEST_VALUE - 3]}..."
