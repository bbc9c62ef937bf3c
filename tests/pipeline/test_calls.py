"""What an attitude costs, and that a known due instant is the one that asking every room would give."""

import pytest
from flying import Companion

from fwav_companion.geometry.stamps import HostNs
from sitl_mock import scenario, simulate
from tests.benchmarks.calls import ATTITUDE_BUDGET, CallCounter, measure


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
    assert (calls.python, calls.native) == (2, 2)


@pytest.mark.slow
def test_an_attitude_stays_within_its_calls():
    attitude, frame = measure()
    assert attitude.budget == ATTITUDE_BUDGET
    assert attitude.ok, attitude
    assert frame.ok, frame
