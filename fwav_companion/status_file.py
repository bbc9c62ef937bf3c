"""SHELL: the status file, rewritten whole each second for ``check`` and scripts; readers never see half of one."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Mapping
from pathlib import Path

NAME = "status.json"


def candidates(configured: str, environment: Mapping[str, str] = os.environ) -> list[Path]:
    """Where it may lie, in order: as configured, else the runtime directories that exist."""
    if configured:
        return [Path(configured)]
    folders = []
    if environment.get("RUNTIME_DIRECTORY"):
        folders.append(Path(environment["RUNTIME_DIRECTORY"].partition(":")[0]))
    folders.append(Path("/run/fwav-companion"))
    if environment.get("XDG_RUNTIME_DIR"):
        folders.append(Path(environment["XDG_RUNTIME_DIR"]) / "fwav-companion")
    return [folder / NAME for folder in folders]


class StatusFile:
    """Writes the newest content in a thread of its own; where nothing can be written, that is told once."""

    def __init__(self, paths: list[Path], on_failure: Callable[[str], None]) -> None:
        """``on_failure`` is called from that thread."""
        self._paths = paths
        self._on_failure = on_failure
        self._newest: bytes | None = None
        self._changed = threading.Event()
        self._told = False
        self._stopping = False
        # A daemon thread: a file system that hangs must not hold up the end of the process.
        self._thread = threading.Thread(target=self._run, name="status file", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def write(self, content: bytes) -> None:
        """Have this written; what is still waiting is replaced."""
        self._newest = content
        self._changed.set()

    def close(self, timeout_s: float) -> None:
        """Remove the file: nobody runs any more."""
        self._stopping = True
        self._changed.set()
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    def _run(self) -> None:
        written: Path | None = None
        while not self._stopping:
            self._changed.wait()
            self._changed.clear()
            if not self._stopping and self._newest is not None:
                written = self._write(self._newest)
        if written is not None:
            written.unlink(missing_ok=True)

    def _write(self, content: bytes) -> Path | None:
        """Where it was written: the first path that may be."""
        why = ""
        for path in self._paths:
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                beside = path.with_name(f".{path.name}.{os.getpid()}")
                beside.write_bytes(content)
                beside.replace(path)
            except OSError as error:
                why = f"{path}: {error.strerror or error}"
                continue
            self._told = False
            return path
        if not self._told:
            self._told = True
            self._on_failure(f"no status file: {why}")
        return None
