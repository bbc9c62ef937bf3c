"""Reads TOML text into a Config. Every error is one line: file, key or line, its value, the accepted values."""

from __future__ import annotations

import math
import re
import tomllib
import typing
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, Final

import msgspec

from fwav_companion.config.document import Config, Document
from fwav_companion.config.key_errors import (
    Complaint,
    KeyPath,
    accepted_text,
    hints_of,
    key_and_value,
    printable,
    shortened,
    spelling_hint,
    table_of,
    unknown_key,
)
from fwav_companion.config.rules import broken_rules
from fwav_companion.errors import ConfigError
from fwav_companion.vision.task import dictionary_key

Tree = dict[str, Any]

LARGEST_NUMBER = 1e9
"""Largest number in any unit: no quantity of a vehicle is larger, and its fourth power is still finite."""
OTHER_SPELLINGS: Final[dict[tuple[str, str], Callable[[str], str]]] = {("vision", "aruco_dictionary"): dictionary_key}
"""Tables and keys that accept several spellings, with the function that returns the first spelling."""
BY_SOURCE: Final = frozenset({"height_bias_m", "heading_bias_deg", "mount_bias_deg"})
"""Keys of [uncertainty] that accept "auto", which is the same as to leave them out: by the source of photographs."""
ARRAYS: Final = frozenset({"link", "target", "pad", "landmark"})
"""Tables of which there may be several."""
REPEATED: Final = ("Cannot declare", "Cannot overwrite a value")
"""Prefixes of the parser's messages about a repeated table or key."""
HEADER: Final = re.compile(r"\s*\[+\s*([\w.]+)\s*\]")
"""A line that begins a table, with its name."""
ASSIGNMENT: Final = re.compile(r"\s*([\w.\"-]+)\s*=\s*(.*?)\s*(?:#.*)?")
"""A line of a key, "=", a value and perhaps a comment."""
CORRECTIONS: Final = (
    (re.compile(r"true|yes|on", re.IGNORECASE), "true", "true or false, in lower case"),
    (re.compile(r"false|no|off", re.IGNORECASE), "false", "true or false, in lower case"),
    (re.compile(r"([-+]?[0-9]+),([0-9]+)"), r"\1.\2", "a decimal point"),
    (re.compile(r"([-+]?)(\.[0-9]+)"), r"\g<1>0\2", "a digit before the point"),
    (re.compile(r"([-+]?[0-9]+\.)"), r"\g<1>0", "a digit after the point"),
    (
        re.compile(r"([-+]?[0-9]+(?:\.[0-9]+)?) *(?:m|s|deg|°|Hz|px|MB|%)\Z"),
        r"\1",
        "a number alone",
    ),
    (re.compile(r"(?![-+0-9.]+$)([^\s\"'\[\]{}=,][^\"'\[\]{}=,]*)"), r'"\1"', "a text in quotes"),
)
"""Patterns of values that TOML does not accept, with the value that the user meant and the reason."""


def parse(text: str, name: str, overrides: Iterable[str] = ()) -> Config:
    """The configuration in ``text`` of the file ``name``, overridden by ``KEY=VALUE`` settings. ConfigError."""
    tree = _toml(text, name)
    overridden = [_override(tree, setting) for setting in overrides]

    def fail(complaint: Complaint) -> typing.NoReturn:
        path, what = complaint
        by_override = any(path[: len(key)] == key for key in overridden)
        raise ConfigError(f"{'--set' if by_override else name}: {key_and_value(tree, path)}: {what}")

    respelled = _respelled(tree)
    for complaint in _form_errors(respelled, Document, ()):
        fail(complaint)
    document = msgspec.convert(respelled, Document)
    for complaint in broken_rules(document):
        fail(complaint)
    sigmas = respelled.get("uncertainty", {})
    stated = frozenset(key for key, value in sigmas.items() if not isinstance(value, str))
    return Config(**msgspec.structs.asdict(document), file=name, stated_sigmas=stated)


def _toml(text: str, name: str) -> Tree:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{name}: {_toml_error(text, str(error))}") from None
    except (RecursionError, ValueError) as error:  # endless nesting; a number of thousands of digits
        raise ConfigError(f"{name}: not readable as TOML ({type(error).__name__}); accepted: TOML 1.0") from None


def _toml_error(text: str, message: str) -> str:
    """The parser's error with the text of the line, which the parser only numbers, and a correction if one is known."""
    lines = text.splitlines()
    numbered = re.search(r"at line (\d+)", message)
    if numbered is None or int(numbered[1]) > len(lines):
        return f"{printable(message)}; accepted: TOML 1.0"
    line = lines[int(numbered[1]) - 1].strip()
    if message.startswith(REPEATED):
        return f"line {numbered[1]}: {shortened(line)}: {_repetition(line, lines[: int(numbered[1]) - 1])}"
    correction = corrected(line)
    what = f"accepted: {printable(correction)}" if correction else f"{printable(message)}; accepted: TOML 1.0"
    return f"line {numbered[1]}: {shortened(line)}: {what}"


def _repetition(line: str, before: Sequence[str]) -> str:
    """Explanation of a repeated table or key, with the line of the first table."""
    header = HEADER.match(line)
    if header is None:
        return "its table has this key already; accepted: each key once in its table"
    if header[1] in ARRAYS:
        return f"accepted: [[{header[1]}]], once for each"
    first = next((n for n, each in enumerate(before, start=1) if (h := HEADER.match(each)) and h[1] == header[1]), None)
    where = "" if first is None else f" in line {first}"
    return f"this table is there already{where}; accepted: each table once, with all its keys"


def corrected(line: str) -> str:
    """The assignment as TOML accepts it, with the reason, where quotes, case or a decimal point are wrong; else ""."""
    assignment = ASSIGNMENT.fullmatch(line)
    if assignment is None:
        return ""
    key, value = assignment[1], assignment[2]
    for pattern, replacement, reason in CORRECTIONS:
        if pattern.fullmatch(value):
            return f"{key} = {pattern.sub(replacement, value)} ({reason})"
    return ""


def _respelled(tree: Tree) -> Tree:
    """The tree with the first spelling of each text. Errors show the user's spelling, which stays in ``tree``."""
    respelled = dict(tree)
    for (table, key), first in OTHER_SPELLINGS.items():
        keys = respelled.get(table)
        if isinstance(keys, dict) and isinstance(keys.get(key), str):
            respelled[table] = {**keys, key: first(keys[key])}
    sigmas = respelled.get("uncertainty")
    if isinstance(sigmas, dict):
        respelled["uncertainty"] = {k: v for k, v in sigmas.items() if k not in BY_SOURCE or v != "auto"}
    return respelled


def _override(tree: Tree, setting: str) -> KeyPath:
    """Apply ``dotted.key=value`` to the tree; returns the key's path. A bare word is a text: shells remove quotes."""
    key, separator, value = setting.partition("=")
    path = tuple(key.strip().split("."))
    if not separator or not all(re.fullmatch(r"[A-Za-z0-9_-]+", part) for part in path):
        raise ConfigError(f"--set: {shortened(setting)}: accepted: KEY=VALUE, as tracking.filter=lowpass")
    table = tree
    for depth, part in enumerate(path[:-1], start=1):
        table = table.setdefault(part, {})
        if not isinstance(table, dict):
            name = ".".join(path[:depth])
            raise ConfigError(f"--set: {shortened(setting)}: {name} is not a table; accepted: a key of a table")
    table[path[-1]] = _override_value(value.strip(), setting)
    return path


def _override_value(value: str, setting: str) -> Any:
    try:
        parsed = tomllib.loads(f"value = {value}")
    except (tomllib.TOMLDecodeError, ValueError, RecursionError):
        is_word = re.fullmatch(r"[A-Za-z0-9_./:\[\]-]+|[-+]?[0-9]+,[0-9]+", value) is not None
        parsed = {"value": value} if is_word else {}
    if parsed.keys() != {"value"}:
        raise ConfigError(f"--set: {shortened(setting)}: accepted: KEY=VALUE with a TOML value, as ground.height_m=1.5")
    return parsed["value"]


def _form_errors(tree: object, form: type[msgspec.Struct], path: KeyPath) -> Iterator[Complaint]:
    """The errors of form in this table, in the file's order: unknown keys, wrong values, missing keys."""
    if not isinstance(tree, dict):
        yield path, "accepted: a table"
        return
    hints = hints_of(form)
    for key, value in tree.items():
        if key not in hints:
            yield (*path, key), unknown_key(key, form, Document)
        else:
            yield from _value_errors(value, hints[key], (*path, key))
    for field in msgspec.structs.fields(form):
        if field.required and field.name not in tree:
            yield (*path, field.name), f"missing; accepted: {accepted_text(hints[field.name])}"


def _value_errors(value: object, hint: Any, path: KeyPath) -> Iterator[Complaint]:
    table = table_of(hint)
    if table is None:
        yield from _leaf_errors(value, hint, path)
    elif typing.get_origin(hint) is not tuple:
        yield from _form_errors(value, table, path)
    elif not isinstance(value, list):
        yield path, f"accepted: tables, each headed [[{path[-1]}]]"
    else:
        for index, element in enumerate(value):
            yield from _form_errors(element, table, (*path, index))


def _leaf_errors(value: object, hint: Any, path: KeyPath) -> Iterator[Complaint]:
    if why := _refused_by_every_key(value):
        yield path, f"{why}; accepted: {accepted_text(hint)}"
        return
    try:
        msgspec.convert(value, hint)
    except msgspec.ValidationError:
        spelling = spelling_hint(value, hint)
        yield path, f"accepted: {accepted_text(hint)}{f'; {spelling}' if spelling else ''}"


def _refused_by_every_key(value: object) -> str:
    """Reason why no key of any type accepts the value; "" where a key may accept it."""
    if isinstance(value, float) and not math.isfinite(value):
        return "not finite"
    if isinstance(value, int | float) and abs(value) > LARGEST_NUMBER:
        return f"beyond {LARGEST_NUMBER:g}"
    if isinstance(value, str) and "\0" in value:
        return "contains a zero byte"
    inside = value if isinstance(value, list) else value.values() if isinstance(value, dict) else ()
    return next(filter(None, map(_refused_by_every_key, inside)), "")
