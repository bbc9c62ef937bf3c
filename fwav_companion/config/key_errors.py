"""How an error names a key: ``[camera.mount] roll_deg = "x"``, ``[[link]] 2 "ground" url = "x"``."""

from __future__ import annotations

from typing import Any

LONGEST_VALUE = 80
"""Characters of a wrong value that are shown: the line must stay one that can be read."""

KeyPath = tuple[str | int, ...]
"""From the file's root: names of tables and keys, indices of lists."""


def key_and_value(tree: dict[str, Any], path: KeyPath) -> str:
    """``[camera.mount] roll_deg = "x"``, ``[[link]] 2 "ground" url = "x"``: the key, and what stood there."""
    if len(path) == 1:
        name = printable(str(path[0]))
        return f"[{name}]" if isinstance(tree.get(str(path[0])), dict) else f"{name}{_standing(tree, path)}"
    if len(path) > 1 and isinstance(path[1], int):
        heading, keys = f"[[{path[0]}]] {path[1] + 1}{_name_of(tree[str(path[0])][path[1]])}", path[2:]
    else:
        heading, keys = _heading(tree, path)
    key = "".join(f"[{part}]" if isinstance(part, int) else f" {printable(part)}" for part in keys)
    return f"{heading}{key}{_standing(tree, path)}" if keys else heading


def _heading(tree: dict[str, Any], path: KeyPath) -> tuple[str, KeyPath]:
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
    return f" {shortened(name)}" if isinstance(name, str) else ""


def _standing(tree: Any, path: KeyPath) -> str:
    """``= VALUE`` of the key; nothing where it is missing."""
    for part in path:
        try:
            tree = tree[part]
        except (KeyError, IndexError, TypeError):
            return ""
    return f" = {shortened(tree)}"


def shortened(value: object) -> str:
    """The value as TOML would write it, roughly, on one line."""
    if isinstance(value, str):
        shown = f'"{printable(value)}"'
    elif isinstance(value, bool):
        shown = str(value).lower()
    else:
        shown = " ".join(repr(value).split())
    return shown if len(shown) <= LONGEST_VALUE else f"{shown[: LONGEST_VALUE - 3]}..."


def printable(text: str) -> str:
    """The text without what would break the line it is shown in."""
    return "".join(c if c.isprintable() else "?" for c in text)
