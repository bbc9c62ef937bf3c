"""Files that others write while we read them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any


class GrowingLines:
    """The lines of a JSONL file, each once, as soon as it is whole; a file that is not there yet has none."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._offset = 0

    def new(self) -> list[dict[str, Any]]:
        """What was added since the last call."""
        try:
            with self._path.open("rb") as file:
                file.seek(self._offset)
                data = file.read()
        except FileNotFoundError:
            return []
        whole = data[: data.rfind(b"\n") + 1]
        self._offset += len(whole)
        return [json.loads(line) for line in whole.splitlines()]


def newest_object(path: Path) -> dict[str, Any]:
    """A small JSON file that is replaced whole; empty while it is not there."""
    try:
        value: dict[str, Any] = json.loads(path.read_bytes())
    except (FileNotFoundError, ValueError):
        return {}
    return value
