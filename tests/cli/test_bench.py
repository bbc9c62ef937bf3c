"""The `bench` command. Measured values are not tested: a busy machine is not a defect."""

import json
import os
import sys
from pathlib import Path

import pytest
from frozen import hold, keys

from fwav_companion.cli.main import main

PROJECT = Path(__file__).parents[2]


@pytest.mark.parametrize("status", [0, 1])
def test_figures_end_in_one_json_object_and_a_missed_budget_in_exit_1(monkeypatch, capsys, status: int):
    monkeypatch.chdir(PROJECT)
    from tests.benchmarks import corruption
    from tests.benchmarks.figure import Figure

    made = [Figure("one", 3.0, 2.0, True, "as it should"), Figure("two", 3.0, 3.0 - status, False, "or not")]
    monkeypatch.setattr(corruption, "measure", lambda: made)
    assert main(["bench", "--only", "corruption", "--json"]) == status
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "one: 3.00 (at least 2.0) ok; as it should"
    reported = json.loads(lines[-1])
    assert reported["ok"] is (status == 0)
    assert [figure["ok"] for figure in reported["figures"]] == [True, status == 0]
    assert reported["figures"][0]["ratio"] == 3.0
    hold("bench", keys([reported], "bench"))


def test_good_frames_lost_beside_corrupted_ones_are_none(monkeypatch, capsys):
    """The only figure that does not depend on the machine."""
    monkeypatch.chdir(PROJECT)
    assert main(["bench", "--only", "corruption"]) == 0
    assert capsys.readouterr().out.startswith("good frames lost beside corrupted ones: 0.00")


def test_an_unknown_benchmark_is_one_line_and_exit_2(monkeypatch, capsys):
    monkeypatch.chdir(PROJECT)
    assert main(["bench", "--only", "speed"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "decode, corruption" in error


def test_without_what_it_compares_with_it_says_what_to_install(monkeypatch, capsys):
    monkeypatch.chdir(PROJECT)
    monkeypatch.setitem(sys.modules, "scipy.spatial.transform", None)
    monkeypatch.delitem(sys.modules, "tests.benchmarks.attitude_at", raising=False)
    assert main(["bench", "--only", "attitude_at"]) == 2
    assert capsys.readouterr().err == (
        "fwav-companion: bench: scipy.spatial.transform is not installed; accepted: pip install '.[test]'\n"
    )
    assert main(["bench", "--only", "corruption"]) == 0, "the others need none of it"


def test_away_from_a_checkout_it_says_so_in_one_line(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("fwav_companion.cli.bench.__file__", os.fspath(tmp_path / "cli/bench.py"))
    assert main(["bench"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "checkout" in error


def test_every_benchmark_can_be_had(monkeypatch):
    monkeypatch.chdir(PROJECT)
    from tests.benchmarks.everything import BENCHMARKS, benchmarks

    assert [name for name, _ in benchmarks()] == list(BENCHMARKS)
    measured = {path.stem for path in (PROJECT / "tests/benchmarks").glob("*.py") if "def measure(" in path.read_text()}
    assert measured == set(BENCHMARKS)
