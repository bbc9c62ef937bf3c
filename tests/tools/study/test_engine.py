"""A study from its first flight to its file: interrupted, continued, with a full disk, on other workers."""

import errno
import os
import shlex
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import msgspec
import psutil
import pytest
from study_plans import CAMERA, CONFIG, InlineWorkers, make_plan

from fwav_companion.cli.main import main
from fwav_companion.errors import UserError
from fwav_companion.tools.study import cluster as cluster_module
from fwav_companion.tools.study import engine
from fwav_companion.tools.study.answer_text import lines
from fwav_companion.tools.study.cluster import WorkersDiedError, decoded, workers
from fwav_companion.tools.study.conclusions import answer_of
from fwav_companion.tools.study.engine import run_study
from fwav_companion.tools.study.flight_record import FlightRecord
from fwav_companion.tools.study.flight_worker import FlightWorker, fly_on_worker
from fwav_companion.tools.study.mock_process import MockError, MockProcess
from fwav_companion.tools.study.paper_preset import paper_plan
from fwav_companion.tools.study.record_file import FILE, JOURNAL, read_records


class Quiet:
    def __init__(self):
        self.total_flights = self.count = 0
        self.seconds = None

    def total(self, flights):
        self.total_flights = flights

    def flown(self):
        self.count += 1

    def expected(self, seconds):
        self.seconds = seconds


def invented(_worker, index, arm):
    """A record without a flight, as a worker returns it."""
    limits = {"position": 1.0, "mount": 0.5, "heading": 0.1}
    varied = {"varied": {}, "flown": {}, "drawn": {}}
    record = FlightRecord(
        index=index, arm=arm, state="found", no_answer="", error_m=1.0 + index % 7, limits_m=limits, **varied
    )
    return msgspec.json.encode(record)


def test_a_study_flies_all_arms_and_writes_the_file(tmp_path):
    progress, plan = Quiet(), make_plan(flights=50)
    finished = run_study(plan, tmp_path, InlineWorkers(invented), progress)
    arms = {arm: sum(record.arm == arm for record in finished.records) for arm in
            ("configured", "twice", "without_position", "without_mount")}  # fmt: skip
    assert arms == {"configured": 50, "twice": 40, "without_position": 40, "without_mount": 40}
    assert progress.count == progress.total_flights == 170
    assert finished.is_complete
    assert not (tmp_path / JOURNAL).exists()
    assert read_records(tmp_path / FILE)[0] == finished.records


def test_the_papers_case_flies_its_filter_and_each_of_its_noises(tmp_path):
    progress = Quiet()
    finished = run_study(paper_plan(6, 1, (), ()), tmp_path, InlineWorkers(invented), progress)
    arms = {record.arm for record in finished.records}
    noises = ("pixel_noise", "attitude_noise", "height_noise")
    assert arms == {"configured", "twice", "paper_filter", *(f"without_{name}" for name in noises)}
    assert progress.count == progress.total_flights == 36
    answer = answer_of(finished.plan, finished.records)
    assert {cause.name for cause in answer.confirmed} == set(noises)
    assert "the paper's low-pass" in next(iter(lines(finished.plan, answer)))


def test_what_an_interrupted_study_flew_is_kept_and_not_flown_again(tmp_path):
    plan = make_plan(flights=6)
    whole = run_study(plan, tmp_path / "whole", InlineWorkers(invented), Quiet())

    def interrupted(worker, index, arm):
        if index == 4:
            raise KeyboardInterrupt
        return invented(worker, index, arm)

    first = run_study(plan, tmp_path / "parts", InlineWorkers(interrupted), Quiet())
    assert (first.is_complete, first.trouble, len(first.records)) == (False, "interrupted", 4)
    again = InlineWorkers(invented)
    second = run_study(plan, tmp_path / "parts", again, Quiet(), resume=True)
    assert second.records == whole.records
    assert (0, "configured") not in again.tasks
    assert (tmp_path / "parts" / FILE).read_bytes() == (tmp_path / "whole" / FILE).read_bytes()


def test_a_killed_study_goes_on_from_its_journal(tmp_path):
    plan = make_plan(flights=6)

    class Killed(BaseException):
        pass

    def killed(worker, index, arm):
        if index == 3:
            raise Killed
        return invented(worker, index, arm)

    with pytest.raises(Killed):
        run_study(plan, tmp_path, InlineWorkers(killed), Quiet())
    assert not (tmp_path / FILE).exists()
    again = InlineWorkers(invented)
    assert run_study(plan, tmp_path, again, Quiet(), resume=True).is_complete
    assert [index for index, arm in again.tasks if arm == "configured"] == [3, 4, 5]


def test_a_full_disk_keeps_what_was_written(tmp_path, monkeypatch):
    plan = make_plan(flights=6)

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patched:
        patched.setattr(engine, "write_records", full)
        finished = run_study(plan, tmp_path, InlineWorkers(invented), Quiet())
    assert "No space left" in finished.trouble
    assert (tmp_path / JOURNAL).exists()
    again = InlineWorkers(invented)
    assert run_study(plan, tmp_path, again, Quiet(), resume=True).is_complete
    assert again.tasks == []


def test_a_long_study_says_how_long_before_it_begins(tmp_path):
    progress = Quiet()
    workers_here = InlineWorkers(invented)
    run_study(make_plan(flights=500), tmp_path, workers_here, progress)
    assert progress.seconds is not None
    assert workers_here.tasks[0] == (0, "configured")


def test_the_mock_is_started_again_where_it_died():
    worker = FlightWorker(make_plan(seconds=1.0))
    first = worker.fly(0, "configured")
    worker._mock._process.kill()
    assert worker.fly(0, "configured") == first
    worker.close()


def test_a_flight_that_the_mock_refuses_says_why():
    with MockProcess() as mock, pytest.raises(MockError, match=r"no option 'flight\.heigth_m'"):
        mock.fly({"set": {"flight.heigth_m": 3}})


# The local cluster.


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


# The command.


@pytest.fixture
def site(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("c.toml").write_text(CONFIG)
    Path("camera.yaml").write_text(CAMERA)
    return tmp_path


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("study", "--config"),
        ("study --config absent.toml", "absent.toml: No such file"),
        ("study --config c.toml --vary flight.hight_m=1:2", 'did you mean "flight.height_m"'),
        ("study --config c.toml --vary tracking.filter=kalman,median", "tracking] filter"),
        ("study --config c.toml --set uncertainty.mount_bias_deg=-1", "a number from 0 to 180"),
        ("study --config c.toml --flights 0", "a whole number from 1"),
        ("study --config c.toml --scheduler host:8786", "accepted: the address of a running Dask scheduler"),
        ("study --config c.toml --only x", "accepted: INDEX"),
        ("study --config c.toml --report-only", "study.parquet: No such file"),
        ("study --preset paper --pattern orbit", "--preset paper has its own"),
        ("study --preset paper --config c.toml", "--preset paper has its own"),
        ("study --config c.toml --vary nonsense=1:2", "flight.height_m, "),
        ("study --recordings empty --set tracking.alpha=0.2", "no recorded flight in it"),
        ("study --recordings absent --set tracking.alpha=0.2", "not a folder"),
        ("study --recordings empty", "no setting to compare"),
        ("study --recordings empty --set flight.height_m=3", "of a simulated flight"),
    ],
)
def test_a_mistake_is_one_line(site, capsys, words, said):
    (site / "empty").mkdir()
    assert main(words.split()) == 2
    line = capsys.readouterr().err
    assert said in line
    assert line.count("\n") == 1


def test_a_single_flight_is_kept_and_its_replay_gives_its_record(site, capsys):
    words = ["study", "--config", "c.toml", "--pattern", "orbit", "--seconds", "6", "--only", "1", "--out", "o"]
    assert main(words) == 0
    record, _, command = capsys.readouterr().out.splitlines()
    record = msgspec.json.decode(record)
    program, *words = shlex.split(command)
    assert program == "fwav-companion"
    assert words[:2] == ["replay", "o/flight-1"]
    assert main([*words, "--json"]) == 0
    summary = msgspec.json.decode(capsys.readouterr().out.splitlines()[-1])
    assert summary["errors"]["targets"][0]["final_m"] == pytest.approx(record["error_m"], rel=1e-6)
    assert (site / "o" / "flight-1" / "report.html").exists()


# Slow: whole clusters.


@pytest.mark.slow
def test_any_number_of_workers_gives_the_same_bytes(tmp_path):
    plan = make_plan(flights=4)
    for count in (1, 2):
        with workers(count=count) as connected:
            run_study(plan, tmp_path / str(count), connected, Quiet())
    assert (tmp_path / "1" / FILE).read_bytes() == (tmp_path / "2" / FILE).read_bytes()


@pytest.mark.slow
def test_a_killed_worker_changes_nothing_in_the_result(tmp_path):
    plan = make_plan(flights=8, seconds=10.0)
    with workers(count=2) as connected:
        run_study(plan, tmp_path / "calm", connected, Quiet())

    class Killing(Quiet):
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
        run_study(plan, tmp_path / "local", connected, Quiet())
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
                    run_study(plan, tmp_path / "by_hand", connected, Quiet())
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
    assert decoded(invented(None, 3, "twice"), FlightRecord).index == 3


def test_study_over_an_earlier_result_is_refused_unless_it_resumes(cluster, tmp_path):
    plan = make_plan(flights=2)
    first = run_study(plan, tmp_path, cluster, Quiet())
    assert first.flown == len(first.records) >= 2
    content = (tmp_path / FILE).read_bytes()
    with pytest.raises(UserError, match=r"flights of an earlier study; accepted: --resume, or another --out"):
        run_study(make_plan(flights=2, seed=9), tmp_path, cluster, Quiet())
    assert (tmp_path / FILE).read_bytes() == content
    assert run_study(plan, tmp_path, cluster, Quiet(), resume=True).flown == 0


def test_study_counts_the_cpu_of_its_workers_and_their_mocks(cluster, tmp_path):
    finished = run_study(make_plan(flights=2), tmp_path, cluster, Quiet())
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
        run_study(plan, tmp_path / "calm", connected, Quiet())

    class Killing(Quiet):
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
        run_study(plan, tmp_path / "lost", connected, Quiet(), resume=True)
    assert (tmp_path / "calm" / FILE).read_bytes() == (tmp_path / "lost" / FILE).read_bytes()
