"""The thread that solves: estimates when they are ready, cancellation, failures, and the interpreter's switches."""

import sys
import threading
from types import SimpleNamespace

import pytest

from fwav_companion.service.background_solver import SWITCH_INTERVAL_S, BackgroundSolver

PATIENCE_S = 20.0


class Task:
    """A solve of some pieces, each of which waits until it is released."""

    def __init__(self, pieces: int = 1, failure: Exception | None = None) -> None:
        self.pieces, self.failure = pieces, failure
        self.done = 0
        self.begun, self.release, self.ended = threading.Event(), threading.Event(), threading.Event()
        self.interval_s = 0.0

    def slices(self):
        try:
            for _ in range(self.pieces):
                self.interval_s = sys.getswitchinterval()
                self.begun.set()
                assert self.release.wait(PATIENCE_S)
                self.done += 1
                yield
            if self.failure is not None:
                raise self.failure
            return SimpleNamespace(pieces=self.done)
        finally:
            self.ended.set()


@pytest.fixture
def solver():
    made = BackgroundSolver()
    yield made
    made.close(PATIENCE_S)


def finished(job):
    """The estimate of a job that is about to end."""
    for _ in range(int(PATIENCE_S * 1000)):
        estimate = job.estimate()
        if estimate is not None:
            return estimate
        threading.Event().wait(0.001)
    raise AssertionError("the solve does not end")


def test_estimate_is_none_until_all_pieces_are_done(solver):
    task = Task(pieces=3)
    job = solver(task)
    assert task.begun.wait(PATIENCE_S)
    assert job.estimate() is None
    task.release.set()
    assert finished(job).pieces == 3


def test_next_solve_cancels_the_one_under_way_between_two_pieces(solver):
    first, second = Task(pieces=1000), Task()
    old = solver(first)
    assert first.begun.wait(PATIENCE_S)
    new = solver(second)
    first.release.set()
    second.release.set()
    assert finished(new).pieces == 1
    assert first.done == 1
    assert old.estimate() is None


def test_failure_of_a_solve_is_raised_where_its_estimate_is_asked_for(solver):
    task, following = Task(failure=ValueError("singular")), Task()
    task.release.set()
    job = solver(task)
    assert task.ended.wait(PATIENCE_S)
    with pytest.raises(ValueError, match="singular"):
        finished(job)
    following.release.set()
    assert finished(solver(following)).pieces == 1


def test_switch_interval_is_short_only_while_a_solve_is_computed(solver):
    usual_s, task = sys.getswitchinterval(), Task()
    job = solver(task)
    assert task.begun.wait(PATIENCE_S)
    assert task.interval_s == pytest.approx(SWITCH_INTERVAL_S)
    task.release.set()
    finished(job)
    for _ in range(int(PATIENCE_S * 1000)):
        if sys.getswitchinterval() == pytest.approx(usual_s):
            break
        threading.Event().wait(0.001)
    assert sys.getswitchinterval() == pytest.approx(usual_s)


def test_close_ends_the_thread_after_the_piece_under_way():
    solver, task = BackgroundSolver(), Task(pieces=1000)
    solver(task)
    assert task.begun.wait(PATIENCE_S)
    task.release.set()
    solver.close(PATIENCE_S)
    assert "solver" not in {thread.name for thread in threading.enumerate()}
    assert task.done < 1000


def test_solver_without_a_solve_starts_no_thread():
    before = threading.active_count()
    solver = BackgroundSolver()
    assert threading.active_count() == before
    solver.close(0.0)
