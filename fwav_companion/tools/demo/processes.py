"""Processes of a demonstration, the files that they write, and the lock of the folder that they share."""

from __future__ import annotations

import ctypes
import fcntl
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import made_folder

STOP_S = 5.0
"""Time that a process has to end after SIGTERM, seconds."""
PR_SET_PDEATHSIG: Final = 1
_libc = ctypes.CDLL(None, use_errno=True)


class ChildProcess:
    """One process of this Python interpreter; its output is kept in a log file."""

    def __init__(self, name: str, module: str, arguments: Sequence[str], log: Path) -> None:
        """``name``: for messages. The process works in the folder of its log file."""
        self.name = name
        self._log = log
        with log.open("wb") as file:
            self._process = subprocess.Popen(  # noqa: S603  # our own interpreter and modules
                [sys.executable, "-m", module, *arguments],
                cwd=log.parent,
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                preexec_fn=_end_with_parent,  # no threads yet
            )

    @property
    def pid(self) -> int:
        """The process id."""
        return self._process.pid

    @property
    def runs(self) -> bool:
        """Whether the process still runs."""
        return self._process.poll() is None

    def trouble(self) -> str | None:
        """Description of the process's failure; None while it runs and after a normal end."""
        status = self._process.poll()
        if not status:
            return None
        if status < 0:
            return f"{self.name} (process {self.pid}) was killed by {signal.Signals(-status).name}"
        output = self._log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        last = f": {output[-1]}" if output else ""
        return f"{self.name} (process {self.pid}) ended with status {status}{last}"

    def stop(self) -> None:
        """Send SIGTERM, and SIGKILL if the process does not end in time."""
        if self.runs:
            self._process.terminate()
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(STOP_S)
        if self.runs:
            self._process.kill()
            self._process.wait()


def _end_with_parent() -> None:
    """Runs between fork and exec: no process of a demonstration outlives it."""
    _libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


class GrowingLines:
    """Reader of a file of lines that another process writes: each whole line once; a missing file has no lines."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._offset = 0

    def new_objects(self) -> list[dict[str, Any]]:
        """The lines since the last call, decoded from JSON."""
        return [json.loads(line) for line in self.new()]

    def new(self) -> list[bytes]:
        """The lines since the last call."""
        try:
            with self._path.open("rb") as file:
                file.seek(self._offset)
                data = file.read()
        except FileNotFoundError:
            return []
        whole = data[: data.rfind(b"\n") + 1]
        self._offset += len(whole)
        return whole.splitlines()


def newest_object(path: Path) -> dict[str, Any]:
    """The content of a small JSON file that another process replaces; empty while the file is missing."""
    try:
        value: dict[str, Any] = json.loads(path.read_bytes())
    except (FileNotFoundError, ValueError):
        return {}
    return value


@contextmanager
def locked_folder(folder: Path) -> Iterator[None]:
    """Creates the folder and locks it: two demonstrations would overwrite each other's files.

    InputFileError where the folder cannot be created, or another demonstration has it.
    """
    try:
        made_folder(folder)
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise InputFileError(f"{error.filename}: {error.strerror}; accepted: a folder to write to") from None
    try:
        # The kernel releases the lock with the process, however that ends: no lock file is left behind.
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError:
        raise InputFileError(f"{folder}: another demonstration uses it; accepted: another folder") from None
    finally:
        os.close(descriptor)
