"""Runs tests for run.py: ``fork_server.py LIBRARY...`` imports the libraries, then forks a process for each request.

A request is a line of JSON on stdin, {"seconds": limit, "words": arguments of pytest}; the answer is a line with the
exit status, or -1 beyond the limit. The package itself is imported in the forked process alone, after the change.
"""

from __future__ import annotations

import importlib
import json
import os
import signal
import sys
import time
from pathlib import Path


def main() -> None:
    """Answer requests until stdin ends."""
    sys.path.insert(0, str(Path.cwd()))
    for name in sys.argv[1:]:
        importlib.import_module(name)
    for line in sys.stdin:
        request = json.loads(line)
        print(_status(request["words"], request["seconds"]), flush=True)


def _status(words: list[str], seconds: float) -> int:
    child = os.fork()
    if child == 0:
        _run(words)
    ends_s = time.monotonic() + seconds
    while time.monotonic() < ends_s:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.02)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return -1


def _run(words: list[str]) -> None:
    os.setsid()
    silent = os.open(os.devnull, os.O_RDWR)
    for descriptor in (0, 1, 2):
        os.dup2(silent, descriptor)
    import pytest

    try:
        status = int(pytest.main([*words, "-W", "ignore::pytest.PytestAssertRewriteWarning"]))
    except BaseException:  # noqa: BLE001  whatever a change breaks
        status = 1
    os._exit(status)


if __name__ == "__main__":
    main()
