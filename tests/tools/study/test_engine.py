"""A study from its first flight to its file: interrupted, continued, with a full disk, on other workers."""

import errno
import os
import shlex
from pathlib import Path

import msgspec
import pytest
from study_plans import CAMERA, CONFIG, CountedProgress, InlineWorkers, invented_record, make_plan

from fwav_companion.cli.main import main
from fwav_companion.tools.study import engine
from fwav_companion.tools.study.answer_text import lines
from fwav_companion.tools.study.conclusions import answer_of
from fwav_companion.tools.study.engine import run_study
from fwav_companion.tools.study.flight_worker import FlightWorker
from fwav_companion.tools.study.mock_process import MockError, MockProcess
from fwav_companion.tools.study.paper_preset import paper_plan
from fwav_companion.tools.study.record_file import FILE, JOURNAL, read_records


def test_a_study_flies_all_arms_and_writes_the_file(tmp_path):
    progress, plan = CountedProgress(), make_plan(flights=50)
    finished = run_study(plan, tmp_path, InlineWorkers(invented_record), progress)
    arms = {arm: sum(record.arm == arm for record in finished.records) for arm in
            ("configured", "twice", "without_position", "without_mount")}  # fmt: skip
    assert arms == {"configured": 50, "twice": 40, "without_position": 40, "without_mount": 40}
    assert progress.count == progress.total_flights == 170
    assert finished.is_complete
    assert not (tmp_path / JOURNAL).exists()
    assert read_records(tmp_path / FILE)[0] == finished.records


def test_the_papers_case_flies_its_filter_and_each_of_its_noises(tmp_path):
    progress = CountedProgress()
    finished = run_study(paper_plan(6, 1, (), ()), tmp_path, InlineWorkers(invented_record), progress)
    arms = {record.arm for record in finished.records}
    noises = ("pixel_noise", "attitude_noise", "height_noise")
    assert arms == {"configured", "twice", "paper_filter", *(f"without_{name}" for name in noises)}
    assert progress.count == progress.total_flights == 36
    answer = answer_of(finished.plan, finished.records)
    assert {cause.name for cause in answer.confirmed} == set(noises)
    assert "the paper's low-pass" in next(iter(lines(finished.plan, answer)))


def test_what_an_interrupted_study_flew_is_kept_and_not_flown_again(tmp_path):
    plan = make_plan(flights=6)
    whole = run_study(plan, tmp_path / "whole", InlineWorkers(invented_record), CountedProgress())

    def interrupted(worker, index, arm):
        if index == 4:
            raise KeyboardInterrupt
        return invented_record(worker, index, arm)

    first = run_study(plan, tmp_path / "parts", InlineWorkers(interrupted), CountedProgress())
    assert (first.is_complete, first.trouble, len(first.records)) == (False, "interrupted", 4)
    again = InlineWorkers(invented_record)
    second = run_study(plan, tmp_path / "parts", again, CountedProgress(), resume=True)
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
        return invented_record(worker, index, arm)

    with pytest.raises(Killed):
        run_study(plan, tmp_path, InlineWorkers(killed), CountedProgress())
    assert not (tmp_path / FILE).exists()
    again = InlineWorkers(invented_record)
    assert run_study(plan, tmp_path, again, CountedProgress(), resume=True).is_complete
    assert [index for index, arm in again.tasks if arm == "configured"] == [3, 4, 5]


def test_a_full_disk_keeps_what_was_written(tmp_path, monkeypatch):
    plan = make_plan(flights=6)

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patched:
        patched.setattr(engine, "write_records", full)
        finished = run_study(plan, tmp_path, InlineWorkers(invented_record), CountedProgress())
    assert "No space left" in finished.trouble
    assert (tmp_path / JOURNAL).exists()
    again = InlineWorkers(invented_record)
    assert run_study(plan, tmp_path, again, CountedProgress(), resume=True).is_complete
    assert again.tasks == []


def test_a_long_study_says_how_long_before_it_begins(tmp_path):
    progress = CountedProgress()
    workers_here = InlineWorkers(invented_record)
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
