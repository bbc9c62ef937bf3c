"""Solves of the smoother between their start and their take-over: in line, in the background, and late."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from fwav_companion.recording.events import late_solve_line
from fwav_companion.recording.line_types import TargetLine
from fwav_companion.replay import driver
from fwav_companion.service.background_solver import BackgroundJob, BackgroundSolver
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


@pytest.fixture(scope="module")
def in_line(flight):
    """The lines of the flight with solves in line, none of them late."""
    return list(replayed(*flight, "third"))


def lines_by(flight, solver, monkeypatch):
    """The lines of the flight with a solver, and the counts of its solves."""
    counts = []
    begin = SmoothedTracker.__init__

    def begun(self, *args, **kwargs):
        begin(self, *args, **kwargs)
        counts.append(self)

    with monkeypatch.context() as patch:
        patch.setattr(SmoothedTracker, "__init__", begun)
        patch.setattr(driver, "RecordedSolver", lambda _: solver)
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


def test_solves_in_a_thread_give_the_same_lines_as_in_line(flight, in_line, monkeypatch):
    solver = BackgroundSolver()
    threaded, counts = lines_by(flight, lambda task: WaitedJob(solver(task)), monkeypatch)
    solver.close(PATIENCE_S)
    assert threaded == in_line
    assert counts.taken >= 3  # two of them with a search, taken over later
    assert counts.late == 0


class HeldJob(BackgroundJob):
    """A job on a loaded board: it is computed when a number of frames have asked for it."""

    FRAMES = 5

    def __init__(self, task):
        super().__init__(task)
        self.asked, self.release, self.done = 0, threading.Event(), threading.Event()

    def compute(self):
        while not self.cancelled and not self.release.wait(0.001):
            pass
        super().compute()
        self.done.set()

    def estimate(self):
        self.asked += 1
        if self.asked > self.FRAMES:
            self.release.set()
            assert self.done.wait(PATIENCE_S)
        return super().estimate()


class LoadedBoard(BackgroundSolver):
    job_type = HeldJob


def test_replay_with_the_recorded_late_solves_gives_the_lines_of_the_flight(flight, in_line, monkeypatch):
    solver, (plan, recording) = LoadedBoard(), flight
    flown, counts = lines_by(flight, solver, monkeypatch)
    late = solver.take_late_frames()
    solver.close(PATIENCE_S)
    assert list(late.values())[:3] == [HeldJob.FRAMES] * 3
    assert counts.late >= 3
    events = b"".join(late_solve_line(0, *each) for each in late.items())
    again = list(replayed(plan, replace(recording, detections=recording.detections + events), "third"))
    assert again == flown
    assert again != in_line


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
