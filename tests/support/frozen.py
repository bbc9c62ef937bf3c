"""Frozen public behaviour: one fact a line in tests/outside/NAME.txt, compared with what is observed.

A fact that vanished breaks a user's script; a fact that appeared is a new promise. The failure names each by its line.
If the change is intended, ``FREEZE=1 pytest ...`` writes the files again: review the difference, and note it in
CHANGELOG.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

FREEZING = bool(os.environ.get("FREEZE"))
FOLDER = Path(__file__).parents[1] / "outside"
KINDS = {bool: "true | false", int: "number", float: "number", str: "text", type(None): "null"}


def frozen(name: str) -> set[str]:
    """The facts of a file; blank lines and lines that begin with # are comments."""
    lines = (FOLDER / f"{name}.txt").read_text().splitlines()
    return {line for line in lines if line and not line.startswith("#")}


def differences(name: str, observed: Iterable[str]) -> list[str]:
    """One line for each fact that appeared or vanished."""
    now, before = set(observed), frozen(name)
    return [
        *(f"vanished from {name}: {fact}" for fact in sorted(before - now)),
        *(f"appeared in {name}: {fact}" for fact in sorted(now - before)),
    ]


def hold(name: str, observed: Iterable[str]) -> None:
    """Fail with one line for each difference; with FREEZE=1 write the file instead."""
    facts = set(observed)
    if FREEZING:
        path = FOLDER / f"{name}.txt"
        heading = [line for line in path.read_text().splitlines() if line.startswith("#")] if path.exists() else []
        path.write_text("\n".join([*heading, *sorted(facts)]) + "\n")
    changed = differences(name, facts)
    assert not changed, "the outside changed:\n" + "\n".join(changed)


def keys(values: Iterable[Any], root: str, tables: Collection[str] = (), opaque: Collection[str] = ()) -> set[str]:
    """``path: kind | kind`` of everything in JSON values: [] for a list's elements, * for a table's keys.

    A path ends in ? where some of its objects lack the key. ``tables``: paths of the objects whose keys are data, as
    the names of links. ``opaque``: paths whose inside is held elsewhere.
    """
    kinds: dict[str, set[str]] = {}
    objects: dict[str, int] = {}
    times: dict[tuple[str, str], int] = {}

    def walk(value: Any, path: str) -> None:
        if isinstance(value, dict):
            kind, inside = "object", value.items()
            objects[path] = objects.get(path, 0) + 1
        elif isinstance(value, list):
            kind, inside = "list", (("[]", each) for each in value)
        else:
            kind, inside = KINDS[type(value)], ()
        kinds.setdefault(path, set()).add(kind)
        if path in opaque:
            return
        for key, inner in inside:
            shown = "*" if path in tables else key
            times[path, shown] = times.get((path, shown), 0) + 1
            walk(inner, f"{path}[]" if kind == "list" else f"{path}.{shown}")

    for value in values:
        walk(value, root)
    seldom = {
        f"{path}.{key}" for (path, key), count in times.items() if key not in ("[]", "*") and count < objects[path]
    }
    return {f"{path}{'?' * (path in seldom)}: {' | '.join(sorted(kind))}" for path, kind in kinds.items()}
