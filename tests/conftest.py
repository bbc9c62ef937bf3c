"""What the test processes of a run share: repeatable examples, kept results, compiled modules; and what each has."""

from __future__ import annotations

import fcntl
import gc
import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import Generator
from pathlib import Path

import pytest
from dealt_tests import dealt
from hypothesis import settings
from kept import FOLDER

from fwav_companion.cli.main import BLAS_THREADS

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")
"""What fails here fails everywhere."""

WAITING_WORKERS = 3
"""Workers beyond one a core: the tests in real time wait for nine tenths of their time."""

LONG_S = 300.0
"""The common time limit (pyproject.toml): a test that has a larger one is long."""


def pytest_xdist_auto_num_workers() -> int | None:
    """The workers of ``-n auto``; None leaves it to the variable that xdist reads."""
    if "PYTEST_XDIST_AUTO_NUM_WORKERS" in os.environ:
        return None
    return len(os.sched_getaffinity(0)) + WAITING_WORKERS


def pytest_configure(config: pytest.Config) -> None:
    """Workers inherit the folder of the process that starts them, and write their services' status files apart."""
    worker = os.environ.get("PYTEST_XDIST_WORKER", "main")
    os.environ.update(dict.fromkeys(BLAS_THREADS, "1"))  # as the commands do; the workers use the cores already
    if not hasattr(config, "workerinput"):
        os.environ[FOLDER] = tempfile.mkdtemp(prefix="fwav-tests-")
        config.add_cleanup(lambda: shutil.rmtree(os.environ.pop(FOLDER), ignore_errors=True))
        _compile_once()
    gc.disable()  # collection frees nothing that a search for garbage would find: 0.4 s of CPU a worker
    runtime = Path(os.environ[FOLDER]) / f"runtime-{worker}"
    runtime.mkdir(exist_ok=True)
    os.environ["RUNTIME_DIRECTORY"] = str(runtime)


def pytest_collection_finish(session: pytest.Session) -> None:
    """Leave what is imported and collected out of garbage collection: it lives to the end. 4 % of the tests' CPU."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    gc.enable()


def _compile_once() -> None:
    """Let this process, the workers and the services that they start share their bytecode, outside of the checkout.

    Measured: a worker collects in 3.6 s of CPU with the bytecode of another, in 8.6 s without; a service starts in
    0.15 s instead of 0.32 s. Where the environment forbids to write bytecode, that was for the checkout's sake.
    """
    folder = os.environ.setdefault("PYTHONPYCACHEPREFIX", str(Path(os.environ[FOLDER]) / "bytecode"))
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    sys.pycache_prefix, sys.dont_write_bytecode = folder, False


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let every worker begin with its share of the long tests, which are those that need a time limit of their own."""
    long = sorted((each for each in items if _limit_s(each) > LONG_S), key=_limit_s, reverse=True)
    short = [each for each in items if _limit_s(each) <= LONG_S]
    items[:] = dealt(long, short, int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")))


def _limit_s(item: pytest.Item) -> float:
    """The time limit that a test has of its own, seconds; 0 without one."""
    mark = item.get_closest_marker("timeout")
    return 0.0 if mark is None else float(mark.args[0])


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """The first worker at a test module compiles it, with its assertions rewritten; the others wait and load that."""
    if not isinstance(collector, pytest.Module):
        return (yield)
    compiled = Path(os.environ[FOLDER], hashlib.sha256(collector.nodeid.encode()).hexdigest()).with_suffix(".compiled")
    with compiled.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not compiled.exists():
            report = yield
            compiled.touch()
            return report
    return (yield)
