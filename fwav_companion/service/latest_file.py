"""SHELL: rewrites small files with their newest content, in a thread of its own. Readers never see a partial file."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from fwav_companion.on_disk import whole

STATUS_NAME = "status.json"
STATUS_MODE = 0o644
"""Permissions of the status file: every user's `check` may read it."""
STATE_MODE = 0o640
"""Permissions of a state file: for the service and its group."""


def status_paths(configured: Path | None, environment: Mapping[str, str] = os.environ) -> list[Path]:
    """Candidate paths of the status file, in order: the configured one, otherwise in a runtime directory."""
    if configured is not None:
        return [configured]
    folders = [Path("/run/fwav-companion")]
    if environment.get("RUNTIME_DIRECTORY"):
        folders.insert(0, Path(environment["RUNTIME_DIRECTORY"].partition(":")[0]))
    if environment.get("XDG_RUNTIME_DIR"):
        folders.append(Path(environment["XDG_RUNTIME_DIR"]) / "fwav-companion")
    return [folder / STATUS_NAME for folder in folders]


def state_path(configured: Path | None, name: str, environment: Mapping[str, str] = os.environ) -> Path | None:
    """A file in the state directory; None if there is no such directory, so that nothing is stored."""
    if configured is not None:
        return configured / name
    folder = environment.get("STATE_DIRECTORY", "").partition(":")[0]
    return Path(folder) / name if folder else None


class LatestFile:
    """Writes the newest content to the first writable path; a failure of all paths is reported once."""

    def __init__(self, paths: Sequence[Path], on_failure: Callable[[str], None], *, outlives_us: bool) -> None:
        """``on_failure`` is called from the thread. ``outlives_us``: sync the file, and keep it at the end."""
        self._paths = paths
        self._on_failure = on_failure
        self._outlives_us = outlives_us
        self._newest: bytes | None = None
        self._changed = threading.Event()
        self._told = False
        self._stopping = False
        # A daemon thread: a file system that hangs must not delay the end of the process.
        self._thread = threading.Thread(target=self._run, name="latest file", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def write(self, content: bytes) -> None:
        """Queue the content; it replaces content that still waits."""
        self._newest = content
        self._changed.set()

    def close(self, timeout_s: float) -> None:
        """Write the waiting content, or remove a file that describes only a running process."""
        self._stopping = True
        self._changed.set()
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    def _run(self) -> None:
        written: Path | None = None
        newest = b""
        stopping = False
        while not stopping:
            self._changed.wait()
            self._changed.clear()
            stopping = self._stopping
            content, self._newest = self._newest, None
            if content is not None and (self._outlives_us or not stopping):
                written, newest = self._write(content), content
        if written is not None and not self._outlives_us:
            _remove_own(written, newest)

    def _write(self, content: bytes) -> Path | None:
        """Write the content; returns the path, or None if every path failed."""
        why = "no directory for it"
        for path in self._paths:
            try:
                self._replace(path, content)
            except OSError as error:
                why = f"{path}: {error.strerror or error}"
                continue
            self._told = False
            return path
        if not self._told:
            self._told = True
            self._on_failure(f"cannot write {why}")
        return None

    def _replace(self, path: Path, content: bytes) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        mode = STATE_MODE if self._outlives_us else STATUS_MODE
        with whole(path, synced=self._outlives_us, mode=mode) as file:
            file.write(content)


def _remove_own(path: Path, newest: bytes) -> None:
    """Remove the file, unless another process has written it since."""
    with suppress(OSError):
        if path.read_bytes() == newest:
            path.unlink()
