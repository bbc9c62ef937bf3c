"""TOML text to a Config. Every error is one line: file, key, what stood there, what is accepted."""

from __future__ import annotations

import math
import re
import tomllib
import typing
from collections.abc import Iterable, Iterator
from typing import Any

import msgspec

from fwav_companion.config.accepted import accepted_text
from fwav_companion.config.document import Config, Document
from fwav_companion.config.inputs import Section
from fwav_companion.config.rules import Complaint, broken_rules
from fwav_companion.config.sections import hints_of, section_of, unknown_key
from fwav_companion.config.wording import KeyPath, key_and_value, printable, shortened
from fwav_companion.errors import ConfigError

Tree = dict[str, Any]

LARGEST_NUMBER = 1e9
"""Of whatever unit: nothing about a vehicle is larger, and a fourth power of it is a number still."""


def parse(text: str, name: str, overrides: Iterable[str] = ()) -> Config:
    """The configuration in ``text`` of the file ``name``, with ``KEY=VALUE`` settings laid over it. ConfigError."""
    tree = _toml(text, name)
    overridden = [_override(tree, setting) for setting in overrides]

    def fail(complaint: Complaint) -> typing.NoReturn:
        path, what = complaint
        by_override = any(path[: len(key)] == key for key in overridden)
        raise ConfigError(f"{'--set' if by_override else name}: {key_and_value(tree, path)}: {what}")

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
        return f"{printable(message)}; accepted: TOML 1.0"
    line = lines[int(numbered[1]) - 1].strip()
    return f"line {numbered[1]}: {shortened(line)}: {printable(message)}; accepted: TOML 1.0"


def _override(tree: Tree, setting: str) -> KeyPath:
    """Lay ``dotted.key=value`` over the tree; the path it set. A bare word is taken as text, as shells eat quotes."""
    key, separator, value = setting.partition("=")
    path = tuple(key.strip().split("."))
    if not separator or not all(re.fullmatch(r"[A-Za-z0-9_-]+", part) for part in path):
        raise ConfigError(f"--set: {shortened(setting)}: accepted: KEY=VALUE, as tracking.filter=lowpass")
    table = tree
    for depth, part in enumerate(path[:-1], start=1):
        table = table.setdefault(part, {})
        if not isinstance(table, dict):
            raise ConfigError(
                f"--set: {shortened(setting)}: {'.'.join(path[:depth])} is no table; accepted: one of its"
            )
    table[path[-1]] = _override_value(value.strip(), setting)
    return path


def _override_value(value: str, setting: str) -> Any:
    try:
        parsed = tomllib.loads(f"value = {value}")
    except (tomllib.TOMLDecodeError, ValueError, RecursionError):
        parsed = {"value": value} if re.fullmatch(r"[A-Za-z0-9_./:\[\]-]+", value) else {}
    if parsed.keys() != {"value"}:
        raise ConfigError(f"--set: {shortened(setting)}: no TOML value; accepted: KEY=VALUE, as ground.height_m=1.5")
    return parsed["value"]


def _form_errors(tree: object, form: type[Section], path: KeyPath) -> Iterator[Complaint]:
    """What in the tree has not the form of this section, in the tree's order."""
    if not isinstance(tree, dict):
        yield path, "accepted: a table"
        return
    hints = hints_of(form)
    for key, value in tree.items():
        if key not in hints:
            yield (*path, key), unknown_key(key, form)
        else:
            yield from _value_errors(value, hints[key], (*path, key))
    for field in msgspec.structs.fields(form):
        if field.required and field.name not in tree:
            yield (*path, field.name), f"missing; accepted: {accepted_text(hints[field.name])}"


def _value_errors(value: object, hint: Any, path: KeyPath) -> Iterator[Complaint]:
    section = section_of(hint)
    if section is None:
        yield from _leaf_errors(value, hint, path)
    elif typing.get_origin(hint) is not tuple:
        yield from _form_errors(value, section, path)
    elif not isinstance(value, list):
        yield path, f"accepted: tables, each headed [[{path[-1]}]]"
    else:
        for index, element in enumerate(value):
            yield from _form_errors(element, section, (*path, index))


def _leaf_errors(value: object, hint: Any, path: KeyPath) -> Iterator[Complaint]:
    if why := _why_no_key_takes(value):
        yield path, f"{why}; accepted: {accepted_text(hint)}"
        return
    try:
        msgspec.convert(value, hint)
    except msgspec.ValidationError:
        yield path, f"accepted: {accepted_text(hint)}"


def _why_no_key_takes(value: object) -> str:
    """Why not, whatever its type asks; "" where nothing of this kind is wrong."""
    if isinstance(value, float) and not math.isfinite(value):
        return "not finite"
    if isinstance(value, int | float) and abs(value) > LARGEST_NUMBER:
        return f"beyond {LARGEST_NUMBER:g}"
    if isinstance(value, str) and "\0" in value:
        return "a zero byte in it"
    inside = value if isinstance(value, list) else value.values() if isinstance(value, dict) else ()
    return next(filter(None, map(_why_no_key_takes, inside)), "")
