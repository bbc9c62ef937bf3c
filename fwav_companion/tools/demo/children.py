"""The processes of a demonstration: started together, watched, and ended whatever happens."""

from __future__ import annotations

import ctypes
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

STOP_S = 5.0
PR_SET_PDEATHSIG: Final = 1
_libc = ctypes.CDLL(None, use_errno=True)


class Child:
    """One process of this Python, what it says kept in a file."""

    def __init__(self, told: str, module: str, arguments: Sequence[str], log: Path, folder: Path) -> None:
        """``told``: what a person would call it; ``folder``: where it works."""
        self.told = told
        self._log = log
        with log.open("wb") as file:
            self._process = subprocess.Popen(  # noqa: S603  # our own interpreter and modules
                [sys.executable, "-m", module, *arguments],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                preexec_fn=_end_with_parent,  # no threads yet
            )

    @property
    def pid(self) -> int:
        """Of the process."""
        return self._process.pid

    @property
    def runs(self) -> bool:
        """Whether it still does."""
        return self._process.poll() is None

    def trouble(self) -> str | None:
        """How it ended, where that was not well; None while it runs or after a good end."""
        status = self._process.poll()
        if not status:
            return None
        if status < 0:
            return f"{self.told} (process {self.pid}) was killed by {signal.Signals(-status).name}"
        said = self._log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        last = f": {said[-1]}" if said else ""
        return f"{self.told} (process {self.pid}) ended with status {status}{last}"

    def stop(self) -> None:
        """Ask it to end, then make it."""
        if self.runs:
            self._process.terminate()
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(STOP_S)
        if self.runs:
            self._process.kill()
            self._process.wait()


def _end_with_parent() -> None:
    """Between fork and exec: nothing of a demonstration outlives it."""
    _libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
