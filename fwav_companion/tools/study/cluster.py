"""SHELL: workers that fly the flights of a study: a Dask cluster on this machine, or a running one.

The local cluster is one process a worker with one thread each, and listens on loopback alone, without a dashboard. A
running cluster executes any code that it is sent: it belongs into a trusted network. After a worker dies, its flights
are repeated.
"""

from __future__ import annotations

import logging
import os
import re
import shutil
import signal
import socket
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from itertools import islice
from typing import Any, Final, TypeAlias

import cloudpickle
import dask
import msgspec
from distributed import Client, KilledWorker, LocalCluster, WorkerPlugin, as_completed, get_worker
from distributed.client import FutureCancelledError
from distributed.comm import CommClosedError

from fwav_companion import __version__
from fwav_companion.errors import CompanionError, UserError
from fwav_companion.service.lean import leave_the_rest_alone
from fwav_companion.tools.study import worker_facts
from fwav_companion.tools.study.record_file import Environment

LOOPBACK: Final = "127.0.0.1"
WAIT_S: Final = 10.0
"""Longest wait for a scheduler, and for its first worker, seconds."""
AHEAD: Final = 3
"""Flights in the queue for each worker: no worker waits for work, and Ctrl-C leaves little to cancel."""
SETTINGS: Final[dict[str, Any]] = {
    "distributed.scheduler.allowed-failures": 3,
    "distributed.scheduler.work-stealing": True,
    "distributed.scheduler.worker-saturation": 1.1,
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.admin.system-monitor.gil.enabled": False,
    "distributed.admin.system-monitor.disk": False,
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": False,
    "distributed.comm.timeouts.connect": f"{WAIT_S:g}s",
}
"""Dask settings. They are explicit, so that a user's own Dask configuration changes nothing here, except TLS. Dask
monitors itself every 20 ms by default, which took 3 % of each core."""

Task: TypeAlias = tuple[Any, ...]
"""Arguments of one piece of work."""
Job: TypeAlias = Callable[..., bytes]
"""A piece of work on a worker: its arguments are the state of :class:`JobPlugin` and a task."""


WORKERLESS_S, LOOK_S, NAP_S = 60.0, 5.0, 0.1
"""Longest time without any worker (a nanny that gave up starts none), interval of looking for one, and of waiting for a
result, seconds."""


class WorkersDiedError(CompanionError):
    """A piece of work failed on every worker that tried it."""


class SchedulerLostError(CompanionError):
    """The connection to the scheduler ended, and did not come back within WAIT_S."""


class JobPlugin(WorkerPlugin):  # type: ignore[misc]  # distributed has no types
    """Keeps the shared state of all work of a worker: the plan, and the mock's process."""

    idempotent = True

    def __init__(self, name: str, make: Callable[..., Any], arguments: Task) -> None:
        """``make(*arguments)`` makes the shared state, at the first piece of work."""
        self.name = name
        self._make, self._arguments = make, arguments
        self._state: Any = None

    def state(self) -> Any:
        """The shared state. Afterwards the worker collects garbage as rarely as the service: saves 6 % of a flight."""
        if self._state is None:
            self._state = self._make(*self._arguments)
            leave_the_rest_alone()
        return self._state

    def teardown(self, worker: Any) -> None:  # noqa: ARG002  # distributed's signature
        """Close the shared state with the worker."""
        if hasattr(self._state, "close"):
            self._state.close()

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_state": None}


class InterruptPlugin(WorkerPlugin):  # type: ignore[misc]  # distributed has no types
    """Leaves Ctrl-C, which reaches every process of a terminal, to the process that started the cluster."""

    name = "fwav-interrupt"
    idempotent = True

    def setup(self, worker: Any) -> None:  # noqa: ARG002  # distributed's signature
        """Ignore SIGINT in the worker's process."""
        with suppress(ValueError):  # not the main thread
            signal.signal(signal.SIGINT, signal.SIG_IGN)


def _work(plugin: str, job: Job, task: Task) -> bytes:
    """One piece of work, on a worker."""
    return job(get_worker().plugins[plugin].state(), *task)


class Workers:
    """A connected cluster."""

    def __init__(self, client: Client) -> None:
        self._client = client
        facts = _facts(client)
        self.count = sum(client.nthreads().values())
        """Number of flights that are flown at the same time."""
        self.environment = Environment(
            tuple(sorted({each["processor"] for each in facts.values()})),
            {name: ", ".join(sorted({each["wheels"][name] for each in facts.values()})) for name in _names(facts)},
        )

    def cpu_s(self) -> float:
        """CPU time of all workers and their mocks so far, seconds; 0 if they cannot be asked."""
        try:
            return float(sum(_of_all(self._client, worker_facts.cpu_seconds).values()))
        except (CommClosedError, OSError):
            return 0.0

    def run(self, job: Job, tasks: Iterable[Task], make: Callable[..., Any], arguments: Task) -> Iterator[bytes]:
        """Results of ``job(make(*arguments), *task)`` as they finish.

        WorkersDiedError, SchedulerLostError, or the job's own UserError.
        """
        plugin = JobPlugin(f"fwav-{os.urandom(8).hex()}", make, arguments)
        self._client.register_plugin(plugin)
        waiting = iter(tasks)
        submitted = as_completed(loop=self._client.loop, raise_errors=False)
        try:
            for task in islice(waiting, AHEAD * max(1, self.count)):
                submitted.add(self._submitted(plugin.name, job, task))
            for future in self._finished(submitted):
                yield _result(future)
                future.release()
                for task in islice(waiting, 1):
                    submitted.add(self._submitted(plugin.name, job, task))
        except (CommClosedError, FutureCancelledError):  # by the call that meets it first
            raise SchedulerLostError("the scheduler is gone") from None
        finally:
            with suppress(Exception):  # the cluster may be gone
                self._client.cancel(list(submitted.futures))
                self._client.unregister_worker_plugin(plugin.name)

    def _finished(self, submitted: Any) -> Iterator[Any]:
        """Each future as it finishes. WorkersDiedError where no worker came for WORKERLESS_S."""
        seen_s = looked_s = time.monotonic()
        while submitted.count():
            batch = submitted.next_batch(block=False)
            yield from batch
            now_s = time.monotonic()
            if batch:
                seen_s = now_s
                continue
            if now_s > looked_s + LOOK_S:
                looked_s = now_s
                seen_s = now_s if self._client.nthreads() else seen_s
            if now_s > seen_s + WORKERLESS_S:
                raise WorkersDiedError(f"no worker for {WORKERLESS_S:.0f} s: every one died; is the memory too small?")
            time.sleep(NAP_S)

    def _submitted(self, plugin: str, job: Job, task: Task) -> Any:
        key = f"{plugin}-{'-'.join(map(str, task))}"
        return self._client.submit(_work, plugin, job, task, key=key, pure=False)


@contextmanager
def workers(scheduler: str = "", count: int | None = None) -> Iterator[Workers]:
    """Workers of the scheduler at this address, else of a local cluster with one worker a core. UserError."""
    _silence("distributed", "asyncio")
    with dask.config.set(SETTINGS), ExitStack() as opened:
        if scheduler:
            client = opened.enter_context(_connected(scheduler))
        else:
            cluster = opened.enter_context(_local(count or len(os.sched_getaffinity(0))))
            client = opened.enter_context(Client(cluster, set_as_default=False))
            client.register_plugin(InterruptPlugin())
        yield Workers(client)


def _silence(*packages: str) -> None:
    """Let these packages log nothing: what a user must know is an error of this module. Dask sets levels of its own."""
    for name in [*packages, *logging.root.manager.loggerDict]:
        if name.partition(".")[0] in packages:
            logging.getLogger(name).setLevel(logging.CRITICAL)


@contextmanager
def _local(count: int) -> Iterator[LocalCluster]:
    folder = tempfile.mkdtemp(prefix="fwav-study-")
    try:
        with LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            host=LOOPBACK,
            dashboard_address=f"{LOOPBACK}:0",
            worker_dashboard_address=f"{LOOPBACK}:0",
            scheduler_kwargs={"dashboard": False},
            memory_limit=0,
            local_directory=folder,
            silence_logs=logging.CRITICAL,
        ) as cluster:
            yield cluster
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _connected(scheduler: str) -> Iterator[Client]:
    accepted = "accepted: the address of a running Dask scheduler, as tcp://192.168.1.20:8786"
    address = re.fullmatch(r"(?:tcp|tls)://(\[[^\]]+\]|[^:/]+):(\d{1,5})", scheduler)
    if address is None or int(address[2]) > 65535:
        raise UserError(f"--scheduler {scheduler}: {accepted}")
    try:
        socket.getaddrinfo(address[1].strip("[]"), int(address[2]))
    except (OSError, UnicodeError) as error:
        raise UserError(f"--scheduler {scheduler}: {getattr(error, 'strerror', None) or error}; {accepted}") from None
    try:
        client = Client(scheduler, timeout=WAIT_S, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        what = " ".join(str(error).split())[:100] or type(error).__name__
        raise UserError(f"--scheduler {scheduler}: no scheduler answers ({what}); {accepted}") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=WAIT_S)
        except TimeoutError:
            raise UserError(f"--scheduler {scheduler}: it has no worker; accepted: one or more `dask worker`") from None
        yield client


def _facts(client: Client) -> dict[str, dict[str, Any]]:
    """Facts about each worker, by its address. UserError if one has another version of this package, or lacks it."""
    facts: dict[str, dict[str, Any]] = _of_all(client, worker_facts.worker_facts)
    for address, each in facts.items():
        if each["package"] != __version__:
            has = f"fwav-companion {each['package']}" if each["package"] else "no fwav-companion"
            raise UserError(f"worker {address} has {has}; accepted: {__version__}, as here")
    return facts


def _of_all(client: Client, question: Callable[[], Any]) -> dict[str, Any]:
    """The answers of all workers by their addresses. The question is sent by value: a worker may lack this package."""
    cloudpickle.register_pickle_by_value(worker_facts)
    try:
        answers: dict[str, Any] = client.run(question)
    finally:
        cloudpickle.unregister_pickle_by_value(worker_facts)
    return answers


def _names(facts: dict[str, dict[str, Any]]) -> list[str]:
    return sorted({name for each in facts.values() for name in each["wheels"]})


def _result(future: Any) -> bytes:
    try:
        result: bytes = future.result()
    except KilledWorker:
        raise WorkersDiedError(f"{future.key}: every worker that tried it died; is the memory too small?") from None
    return result


def decoded(result: bytes, kind: type[msgspec.Struct]) -> Any:
    """A result as the struct that the worker encoded."""
    return msgspec.json.decode(result, type=kind)
