"""What an attitude and a frame cost, and that a known due instant is the one that asking every room would give."""

from pathlib import Path

import pytest
from flying import Companion

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import add
from sitl_mock import scenario, simulate
from tests.benchmarks.calls import ATTITUDE_BUDGET, CallCounter, measure
from tests.benchmarks.instructions import SEARCH, SOLVE, TRACKER, counted, inclusive


class AskedAgain(Companion):
    """A companion that computes the due instant again after every input."""

    known = 0
    """Inputs after which it was known."""

    def _flushed(self, now: HostNs) -> list[bytes]:
        sent = super()._flushed(now)
        if self.pipeline._due_is_known:
            self.known += 1
            kept = self.pipeline.wake_at
            self.pipeline._due_is_known = False
            assert self.pipeline.wake_at == kept
        return sent


@pytest.mark.parametrize("settings", [(), ("vehicle.position=none",)])
def test_a_due_instant_that_stays_known_is_the_right_one(settings: tuple[str, ...]):
    mock = simulate(scenario("default").but({"seconds": 12.0, "seed": 5}))
    companion = AskedAgain(settings, unix_minus_host_s=mock.unix_minus_host_s)
    for _ in mock.drive(companion):
        pass
    assert companion.known > 500


def test_calls_are_counted_without_those_of_the_counter():
    def inner() -> int:
        return abs(-1)

    def work() -> int:
        return inner() + inner()

    result, calls = CallCounter().counted(work)
    assert result == 2
    assert (calls.python, calls.native, calls.own) == (2, 2, 0)


def test_calls_of_the_package_are_counted_by_themselves():
    _, calls = CallCounter().counted(lambda: add((1.0, 2.0, 3.0), (0.0, 0.0, 1.0)))
    assert (calls.python, calls.own) == (1, 1)


@pytest.mark.parametrize("function", [TRACKER, SOLVE, SEARCH])
def test_work_that_an_iterator_calls_is_done_once_and_returns_its_result(function: str):
    done = []
    assert counted(function, lambda: done.append(1) or len(done)) == 1
    assert done == [1]


def test_an_error_of_work_that_an_iterator_calls_is_raised():
    with pytest.raises(ZeroDivisionError):
        counted(SOLVE, lambda: 1 // 0)


def test_instructions_of_a_function_are_its_own_and_those_of_what_it_calls(tmp_path: Path):
    part = tmp_path / "out.1"
    part.write_text(
        f"fn={TRACKER}\n10 5\ncfn=other\ncalls=1 20\n11 700\n\n"
        f"fn=other\n20 600\ncfn={SOLVE}\ncalls=2 30\n21 90\n\nfn={SOLVE}\n30 90\ntotals: 1000\n"
    )
    assert inclusive(part) == {TRACKER: 705, SOLVE: 90, "": 1000}


@pytest.mark.slow
def test_an_attitude_stays_within_its_calls():
    attitude, frame = measure()
    assert attitude.budget == ATTITUDE_BUDGET
    assert attitude.ok, attitude
    assert frame.ok, frame
