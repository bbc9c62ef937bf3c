"""What the test processes of a run share: repeatable examples, a folder of kept results, a runtime directory each."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

import pytest
from hypothesis import settings
from kept import FOLDER

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")
"""What fails here fails everywhere."""

WAITING_WORKERS = 2
"""Workers beyond one a core: the tests in real time wait for nine tenths of their time."""


def pytest_xdist_auto_num_workers() -> int | None:
    """The workers of ``-n auto``; None leaves it to the variable that xdist reads."""
    if "PYTEST_XDIST_AUTO_NUM_WORKERS" in os.environ:
        return None
    return len(os.sched_getaffinity(0)) + WAITING_WORKERS


def pytest_configure(config: pytest.Config) -> None:
    """Workers inherit the folder of the process that starts them, and write their services' status files apart."""
    worker = os.environ.get("PYTEST_XDIST_WORKER", "main")
    if not hasattr(config, "workerinput"):
        os.environ[FOLDER] = tempfile.mkdtemp(prefix="fwav-tests-")
        config.add_cleanup(lambda: shutil.rmtree(os.environ.pop(FOLDER), ignore_errors=True))
    runtime = Path(os.environ[FOLDER]) / f"runtime-{worker}"
    runtime.mkdir(exist_ok=True)
    os.environ["RUNTIME_DIRECTORY"] = str(runtime)
