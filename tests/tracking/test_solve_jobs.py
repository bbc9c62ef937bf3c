"""Solves of the smoother between their start and their take-over: in line, in the background, and late."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from fwav_companion.recording.line_types import TargetLine
from fwav_companion.replay import driver
from fwav_companion.service.background_solver import BackgroundSolver
from fwav_companion.tracking.smoothed.smoothed_tracker import SmoothedTracker
from fwav_companion.tracking.smoothed.solve_jobs import InLineJob
from tests.accuracy.flights import plan_of, recording_of, replayed

PATIENCE_S = 60.0


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """Some seconds of a hover above one target."""
    plan = plan_of("hover_1", 1)
    plan = replace(plan, name="hover-short", options=plan.options.but({"seconds": 8.0}))
    return plan, recording_of(plan, tmp_path_factory.mktemp("flights"))


def lines_by(flight, solver, monkeypatch):
    """The lines of the flight with a solver, and the counts of its solves."""
    counts = []
    begin = SmoothedTracker.__init__

    def begun(self, *args, **kwargs):
        begin(self, *args, **kwargs)
        counts.append(self)

    with monkeypatch.context() as patch:
        patch.setattr(SmoothedTracker, "__init__", begun)
        patch.setattr(driver, "InLineJob", solver)
        lines = list(replayed(*flight, "third"))
    return lines, counts[0].solves


class WaitedJob:
    """A job of a thread that is waited for: a board that is fast enough."""

    def __init__(self, job):
        self._job = job

    def estimate(self):
        while (estimate := self._job.estimate()) is None:
            threading.Event().wait(0.001)
        return estimate


class LateJob(InLineJob):
    """A solve that is ready only when it has been asked for a number of times."""

    __slots__ = ("asked",)
    READY = 5

    def __init__(self, task):
        super().__init__(task)
        self.asked = 0

    def estimate(self):
        self.asked += 1
        return super().estimate() if self.asked > self.READY else None


def test_solves_in_a_thread_give_the_same_lines_as_in_line(flight, monkeypatch):
    solver = BackgroundSolver()
    in_line, counts = lines_by(flight, InLineJob, monkeypatch)
    threaded, _ = lines_by(flight, lambda task: WaitedJob(solver(task)), monkeypatch)
    solver.close(PATIENCE_S)
    assert threaded == in_line
    assert counts.taken >= 3  # two of them with a search, taken over later
    assert counts.late == 0


def test_late_solves_are_counted_once_each_and_taken_over_when_they_are_ready(flight, monkeypatch):
    _, counts = lines_by(flight, LateJob, monkeypatch)
    assert counts.taken > 2
    assert counts.late == counts.taken


def test_solves_that_never_end_leave_the_answers_of_the_filters(flight, monkeypatch):
    class Never(LateJob):
        READY = 10**9

    lines, counts = lines_by(flight, Never, monkeypatch)
    assert (counts.taken, counts.late) == (0, 1)
    confirmed = [line for line in lines if isinstance(line, TargetLine) and line.state == "confirmed"]
    assert len(confirmed) > 50


@pytest.mark.parametrize("failure", ["singular", "not finite"])
def test_solve_that_fails_is_counted_and_leaves_the_answers_of_the_filters(flight, monkeypatch, failure):
    class Failing(InLineJob):
        __slots__ = ()

        def estimate(self):
            if failure == "singular":
                raise np.linalg.LinAlgError("Singular matrix")
            return replace(super().estimate(), mean=np.full(3, np.nan))

    lines, counts = lines_by(flight, Failing, monkeypatch)
    assert counts.taken == 0
    assert counts.failed >= 2
    assert lines[-1].final == []
    assert [line for line in lines if isinstance(line, TargetLine) and line.state == "confirmed"]
