"""SHELL: does the steps of an installation, below a root."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from fwav_companion.errors import UserError
from fwav_companion.on_disk import made_folder, whole
from fwav_companion.tools.install.observing import below
from fwav_companion.tools.install.source import installed_package, write_wheel
from fwav_companion.tools.install.steps import (
    AwaitHeartbeat,
    MakeEnvironment,
    PointLink,
    Remark,
    RemovePath,
    RenamePath,
    Run,
    Step,
    WriteFile,
)
from fwav_companion.tools.install.system import STATUS

HEARTBEAT_S: Final = 45.0
"""Time for the first heartbeat, seconds: the unit's TimeoutStartSec, and half of it more for a slow board's status."""
UP_S: Final = 2.0
"""Time since the start after which heartbeats, one a second, have left."""
POLL_S: Final = 0.5

Command = Callable[[Sequence[str]], int]


class StepError(Exception):
    """A step that failed; the message says which and what to do."""


def ran(command: Sequence[str]) -> int:
    """Run a command, with its output on ours, and return its status; 127 if there is no such program."""
    try:
        return subprocess.run(command, check=False).returncode  # noqa: S603  # the words are the plan's
    except FileNotFoundError:
        return 127


class Execution:
    """Does steps below a root."""

    def __init__(
        self,
        root: Path,
        *,
        command: Command = ran,
        say: Callable[[str], None] = print,
        heartbeat_s: float = HEARTBEAT_S,
    ) -> None:
        self._root = root
        self._command = command
        self._say = say
        self._heartbeat_s = heartbeat_s
        self._began_s = time.monotonic()

    def do(self, steps: Sequence[Step]) -> None:
        """Do the steps in order, and report each before it is done. StepError at the first that fails."""
        for step in steps:
            self._say(str(step))
            try:
                self._do(step)
            except OSError as error:
                raise StepError(f"{error.filename}: {error.strerror}") from None

    def _do(self, step: Step) -> None:
        match step:
            case WriteFile():
                self._write(step)
            case RemovePath():
                self._remove(below(self._root, step.path))
            case RenamePath():
                below(self._root, step.path).rename(below(self._root, step.to))
            case PointLink():
                self._point(step)
            case MakeEnvironment():
                self._make(step)
            case Run():
                self._run(step.command, optional=step.optional)
            case AwaitHeartbeat():
                self._await(step)
            case Remark():
                pass

    def _write(self, step: WriteFile) -> None:
        path = below(self._root, step.path)
        made_folder(path.parent)
        if step.keep and path.exists() and not below(self._root, step.keep).exists():
            shutil.copy2(path, below(self._root, step.keep))
        existed = path.exists()
        with whole(path, synced=True) as file:
            file.write(step.content.encode())
        if not existed:
            path.chmod(step.mode)

    @staticmethod
    def _remove(path: Path) -> None:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)

    def _point(self, step: PointLink) -> None:
        """Point a link below the root to the target's path on the board, by a rename: the link is never missing."""
        path = below(self._root, step.path)
        made_folder(path.parent)
        new = path.with_name(f".{path.name}.new")
        new.unlink(missing_ok=True)
        relative = os.path.relpath(step.target, os.path.dirname(step.path))  # noqa: PTH120  # holds in any root
        new.symlink_to(relative)
        new.replace(path)

    def _make(self, step: MakeEnvironment) -> None:
        path = below(self._root, step.path)
        made_folder(path.parent)
        try:
            self._run([sys.executable, "-m", "venv", *(["--system-site-packages"] if step.system_packages else []),
                       str(path)])  # fmt: skip
            with tempfile.TemporaryDirectory() as folder:
                for arguments in _pip_arguments(step, Path(folder)):
                    prefix = ["linux32"] if step.linux32 else []
                    self._run([*prefix, str(path / "bin" / "python"), "-m", "pip", "install", "--quiet", *arguments])
            self._readdress(path, step.path)
        except BaseException:  # Ctrl-C too: half an environment must not remain
            shutil.rmtree(path, ignore_errors=True)
            raise

    def _readdress(self, path: Path, on_board: str) -> None:
        """Let the scripts of an environment below a root name the interpreter by its path on the board."""
        if str(path) == on_board:
            return
        for script in (path / "bin").iterdir():
            if script.is_file() and not script.is_symlink():
                text = script.read_bytes()
                script.write_bytes(text.replace(str(path).encode(), on_board.encode()))

    def _run(self, command: Sequence[str], *, optional: bool = False) -> None:
        status = self._command(command)
        if status == 0:
            return
        failure = f"{' '.join(command)}: " + ("there is no such program" if status == 127 else f"exit status {status}")
        if not optional:
            raise StepError(failure)
        self._say(f"WARNING {failure}")

    def _await(self, step: AwaitHeartbeat) -> None:
        end_s = time.monotonic() + self._heartbeat_s
        while time.monotonic() < end_s:
            if self._heartbeat_came():
                return
            time.sleep(POLL_S)
        self.do(step.otherwise)
        back = "the old environment is back; " if step.otherwise else ""
        raise StepError(f"no heartbeat in {self._heartbeat_s:.0f} s; {back}see journalctl -u fwav-companion -n 50")

    def _heartbeat_came(self) -> bool:
        """Return whether a service that started after us has run long enough to send heartbeats, without a fault."""
        try:
            status = json.loads(below(self._root, STATUS).read_bytes())
            started_s = status["time_monotonic"] - status["up_s"]  # the wall clock may step
            return bool(started_s >= self._began_s and status["up_s"] >= UP_S and status["internal_faults"] == 0)
        except (OSError, ValueError, KeyError, TypeError):
            return False


def _pip_arguments(step: MakeEnvironment, folder: Path) -> list[list[str]]:
    """Return the arguments of each `pip install`: locked libraries first, then the program without any other."""
    locked = [word for lock in step.locks for word in ("-r", lock)]
    arguments = [["--require-hashes", "--only-binary", ":all:", *locked]] if locked else []
    if step.source:
        wanted, alone = step.source, ["--no-build-isolation"]
    else:
        wanted, alone = str(write_wheel(folder, installed_package())), []
    if locked:
        return [*arguments, ["--no-deps", *alone, wanted]]
    extras = f"[{','.join(step.extras)}]" if step.extras else ""
    return [[f"{wanted}{extras}"]]


def require_root(root: Path, *, dry: bool) -> None:
    """Check that the steps may be done. UserError where the board itself is to be changed by another user than root."""
    if not dry and root == Path("/") and os.geteuid() != 0:
        raise UserError("install: only root may change this system; accepted: sudo, --root DIR, or --dry-run")
