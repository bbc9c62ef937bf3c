"""max_rate_hz: the mean rate is kept with any jitter, and other messages are not thinned."""

from __future__ import annotations

import random

import pytest

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.router.rate_limiter import MAX_STREAMS, RateLimiter

ATTITUDE, BATTERY_STATUS = 30, 147
MS = 1_000_000


def passed(
    thinner: RateLimiter, instants_ms: list[float], msgid: int = ATTITUDE, sender: int = 257, instance: int = 0
) -> int:
    return sum(thinner.passes(msgid, sender, instance, HostNs(round(at * MS))) for at in instants_ms)


@pytest.mark.parametrize(("rate", "source"), [(4, 100), (4, 50), (7, 100), (30, 100), (50, 100), (99, 100), (10, 10)])
def test_the_mean_rate_is_the_one_asked_for(rate, source) -> None:
    rng = random.Random(1)
    instants = [i * 1000 / source + rng.uniform(-0.2, 0.2) * 1000 / source for i in range(source * 60)]
    assert passed(RateLimiter({"ATTITUDE": rate}), instants) == pytest.approx(60 * rate, abs=2)


def test_a_slower_stream_is_left_alone() -> None:
    assert passed(RateLimiter({"ATTITUDE": 4}), [i * 500.0 for i in range(20)]) == 20


def test_a_pause_is_not_saved_up() -> None:
    thinner = RateLimiter({"ATTITUDE": 4})
    passed(thinner, [0.0])
    assert passed(thinner, [60_000 + i * 10.0 for i in range(100)]) <= 5


def test_a_rate_that_rises_again_counts_at_once():
    """A link that was nearly full for a second does not silence a stream for a minute."""
    thinner = RateLimiter({})

    def passes(at_s: float, hz: float) -> bool:
        return thinner.passes(ATTITUDE, 257, 0, HostNs(round(at_s * 1000 * MS)), at_most_hz=hz)

    assert passes(0.0, 0.01)
    assert not passes(1.0, 0.01)
    assert passes(1.2, 1.0)
    assert not passes(1.3, 1.0)


def test_what_is_not_named_passes_always() -> None:
    thinner = RateLimiter({"ATTITUDE": 4})
    assert not thinner.limits(76)
    assert passed(thinner, [0.0] * 50, msgid=76) == 50


def test_zero_lets_none_pass() -> None:
    assert passed(RateLimiter({"ATTITUDE": 0}), [0.0, 5000.0]) == 0


def test_senders_and_instances_have_the_rate_each() -> None:
    thinner = RateLimiter({"ATTITUDE": 4, "BATTERY_STATUS": 1})
    assert [passed(thinner, [0.0], sender=sender) for sender in (257, 513)] == [1, 1]
    assert [passed(thinner, [0.0], BATTERY_STATUS, instance=i) for i in (0, 1, 0)] == [1, 1, 0]


def test_the_table_is_bounded() -> None:
    thinner = RateLimiter({"ATTITUDE": 4})
    for sender in range(5 * MAX_STREAMS):
        thinner.passes(ATTITUDE, sender, 0, HostNs(0))
    assert len(thinner._slots_ns) <= MAX_STREAMS
