"""SHELL: the board's files, from its root or from a folder that looks like one. Reads only; nothing here raises."""

from __future__ import annotations

import grp
from pathlib import Path


class Tree:
    """Paths of the board, by their absolute names."""

    def __init__(self, root: Path = Path("/")) -> None:
        self._root = root

    def at(self, path: str) -> Path:
        """Where that is."""
        return self._root / path.lstrip("/")

    def text(self, path: str) -> str:
        """A file's content, stripped; "" where there is none."""
        return text_of(self.at(path))

    def listed(self, path: str) -> list[Path]:
        """What a folder holds, in order; nothing where there is none."""
        try:
            return sorted(self.at(path).iterdir())
        except OSError:
            return []


def is_there(path: Path) -> bool:
    """Whether that is, as far as we may see: Path.exists raises for what it may not look at."""
    try:
        path.stat()
    except OSError:
        return False
    return True


def text_of(path: Path) -> str:
    """A file's content, stripped; "" where there is none."""
    try:
        return path.read_text(errors="replace").strip("\0\n ")
    except OSError:
        return ""


def group_of(path: Path) -> str:
    """The name of the group that a file belongs to; "" where it has none."""
    try:
        return grp.getgrgid(path.stat().st_gid).gr_name
    except (OSError, KeyError):
        return ""
