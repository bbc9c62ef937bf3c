"""A study on workers of its own and of others: same bytes, and each failure one line."""

import os
import signal
import socket
import subprocess
import sys
import time

import msgspec
import psutil
import pytest
from study_plans import CountedProgress, invented_record, make_plan

from fwav_companion.errors import UserError
from fwav_companion.tools.study import cluster as cluster_module
from fwav_companion.tools.study.cluster import WorkersDiedError, decoded, workers
from fwav_companion.tools.study.engine import run_study
from fwav_companion.tools.study.flight_record import FlightRecord
from fwav_companion.tools.study.flight_worker import FlightWorker, fly_on_worker
from fwav_companion.tools.study.record_file import FILE


def ours() -> list[psutil.Process]:
    process = psutil.Process()
    return [process, *process.children(recursive=True)]


def test_the_local_cluster_listens_on_loopback_alone(cluster):
    assert cluster.count == 2
    listening = [c.laddr.ip for process in ours() for c in process.net_connections() if c.status == "LISTEN"]
    assert listening
    assert set(listening) <= {"127.0.0.1", "::1"}


def test_workers_fly_what_this_process_flies(cluster):
    plan = make_plan(seconds=6.0)
    tasks = [(0, "configured"), (1, "configured"), (0, "twice")]
    found = sorted(cluster.run(fly_on_worker, tasks, FlightWorker, (plan,)))
    here = FlightWorker(plan)
    assert found == sorted(here.fly(*task) for task in tasks)
    here.close()


def explodes(_worker, *_):
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_user_error_on_a_worker_is_one_here(cluster):
    plan = msgspec.structs.replace(make_plan(), config="[tracking]\nfiltre = 1\n")
    with pytest.raises(UserError, match='did you mean "filter"'):
        list(cluster.run(fly_on_worker, [(0, "configured")], FlightWorker, (plan,)))


def test_a_worker_with_another_version_is_refused_by_name(cluster, monkeypatch):
    monkeypatch.setattr(cluster_module, "__version__", "99.0")
    with pytest.raises(UserError, match=r"worker tcp://127\.0\.0\.1:\d+ has fwav-companion .*; accepted: 99\.0"):
        cluster_module._facts(cluster._client)


def test_a_scheduler_that_is_not_there_is_one_line(monkeypatch):
    monkeypatch.setattr(cluster_module, "WAIT_S", 1.0)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(UserError) as raised, workers(address):
            pass
    assert "no scheduler answers" in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.slow
def test_any_number_of_workers_gives_the_same_bytes(tmp_path):
    plan = make_plan(flights=4)
    for count in (1, 2):
        with workers(count=count) as connected:
            run_study(plan, tmp_path / str(count), connected, CountedProgress())
    assert (tmp_path / "1" / FILE).read_bytes() == (tmp_path / "2" / FILE).read_bytes()


@pytest.mark.slow
def test_a_killed_worker_changes_nothing_in_the_result(tmp_path):
    plan = make_plan(flights=8, seconds=10.0)
    with workers(count=2) as connected:
        run_study(plan, tmp_path / "calm", connected, CountedProgress())

    class Killing(CountedProgress):
        def flown(self):
            super().flown()
            if self.count == 3:
                spawned = [p for p in psutil.Process().children(recursive=True) if "sitl_mock" in p.cmdline()]
                psutil.Process(spawned[0].ppid()).kill()

    with workers(count=2) as connected:
        finished = run_study(plan, tmp_path / "killed", connected, Killing())
    assert finished.is_complete
    assert (tmp_path / "calm" / FILE).read_bytes() == (tmp_path / "killed" / FILE).read_bytes()


@pytest.mark.slow
def test_a_cluster_started_by_hand_gives_the_bytes_of_the_local_one(tmp_path):
    plan = make_plan(flights=4)
    with workers(count=2) as connected:
        run_study(plan, tmp_path / "local", connected, CountedProgress())
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    dask = [sys.executable, "-m", "dask"]
    scheduler = [*dask, "scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
    worker = [*dask, "worker", address, "--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1"]
    started = [
        subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        for command in (scheduler, worker, worker)
    ]
    try:
        for _ in range(60):
            try:
                with workers(address) as connected:
                    run_study(plan, tmp_path / "by_hand", connected, CountedProgress())
                break
            except UserError:
                time.sleep(1.0)
    finally:
        for process in started:
            process.terminate()
        for process in started:
            process.wait(30)
    assert (tmp_path / "local" / FILE).read_bytes() == (tmp_path / "by_hand" / FILE).read_bytes()


@pytest.mark.slow
def test_work_that_kills_every_worker_is_one_line():
    with workers(count=1) as connected, pytest.raises(WorkersDiedError, match=r"every (worker that tried it|one) died"):
        list(connected.run(explodes, [(0, "configured")], FlightWorker, (make_plan(),)))


def test_a_result_is_decoded_as_the_record_that_was_encoded():
    assert decoded(invented_record(None, 3, "twice"), FlightRecord).index == 3


def test_study_over_an_earlier_result_is_refused_unless_it_resumes(cluster, tmp_path):
    plan = make_plan(flights=2)
    first = run_study(plan, tmp_path, cluster, CountedProgress())
    assert first.flown == len(first.records) >= 2
    content = (tmp_path / FILE).read_bytes()
    with pytest.raises(UserError, match=r"flights of an earlier study; accepted: --resume, or another --out"):
        run_study(make_plan(flights=2, seed=9), tmp_path, cluster, CountedProgress())
    assert (tmp_path / FILE).read_bytes() == content
    assert run_study(plan, tmp_path, cluster, CountedProgress(), resume=True).flown == 0


def test_study_counts_the_cpu_of_its_workers_and_their_mocks(cluster, tmp_path):
    finished = run_study(make_plan(flights=2), tmp_path, cluster, CountedProgress())
    assert 0.01 < finished.cpu_s / finished.flown < 60.0


@pytest.mark.parametrize("address", ["tcp://127.0.0.1", "127.0.0.1:8786", "tcp://127.0.0.1:99999", "tcp://:8786"])
def test_scheduler_address_without_a_host_or_port_is_refused_at_once(address):
    with pytest.raises(UserError, match=r"accepted: the address of a running Dask scheduler"), workers(address):
        pass


def test_scheduler_host_that_does_not_exist_is_named_as_such():
    address = "tcp://no-such-host.invalid:8786"
    with pytest.raises(UserError, match=r"invalid:8786: .*(not known|resolution)"), workers(address):
        pass


@pytest.mark.slow
def test_scheduler_that_dies_midway_is_one_line_and_the_study_resumes_to_the_same_bytes(tmp_path):
    plan = make_plan(flights=6)
    with workers(count=1) as connected:
        run_study(plan, tmp_path / "calm", connected, CountedProgress())

    class Killing(CountedProgress):
        def flown(self):
            super().flown()
            if self.count == 2:
                connected._client.cluster.scheduler.stop()
                connected._client.cluster.sync(connected._client.cluster.scheduler.close)

    with workers(count=1) as connected:
        finished = run_study(plan, tmp_path / "lost", connected, Killing())
    assert finished.trouble == "the scheduler is gone"
    assert not finished.is_complete
    with workers(count=1) as connected:
        run_study(plan, tmp_path / "lost", connected, CountedProgress(), resume=True)
    assert (tmp_path / "calm" / FILE).read_bytes() == (tmp_path / "lost" / FILE).read_bytes()
