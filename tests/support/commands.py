"""``fwav-companion COMMAND`` in the test's own process: starting Python costs more than most commands."""

from __future__ import annotations

import io
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from subprocess import CompletedProcess

from fwav_companion.cli.main import main


def run_command(*words: str, folder: Path) -> CompletedProcess[str]:
    """Exit status and texts of the command, run in the folder. It must neither load users' code nor use descriptors."""
    out, err = io.StringIO(), io.StringIO()
    with chdir(folder), redirect_stdout(out), redirect_stderr(err):
        status = main(list(words))
    return CompletedProcess(words, status, out.getvalue(), err.getvalue())
