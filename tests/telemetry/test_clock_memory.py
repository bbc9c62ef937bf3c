"""The clock's memory is bounded, whatever comes and for however long."""

import gc
import random
import sys
from collections.abc import Callable
from types import FunctionType, ModuleType

import pytest

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, BootNs, HostNs
from fwav_companion.telemetry.clock.boot_time import BootTimeline
from fwav_companion.telemetry.clock.clock import Clock
from fwav_companion.types import ClockExchange

AHEAD_NS = 9_000 * NS_PER_S
HOUR = 36_000
"""Inputs of an hour at 10 Hz."""
Input = Callable[[Clock, random.Random, int], object]


def reached_bytes(root: object) -> int:
    """Size of all objects that are reached from one, but for types, functions and modules."""
    seen, waiting, size = {id(root)}, [root], 0
    while waiting:
        each = waiting.pop()
        size += sys.getsizeof(each)
        for other in gc.get_referents(each):
            if id(other) not in seen and not isinstance(other, type | FunctionType | ModuleType):
                seen.add(id(other))
                waiting.append(other)
    return size


def exchange(clock: Clock, rng: random.Random, k: int) -> None:
    up, down = (round(rng.expovariate(1.0) * NS_PER_MS) for _ in range(2))
    sent = HostNs(AHEAD_NS + k * NS_PER_S // 10)
    clock.on_exchange(ClockExchange(sent, HostNs(sent + up + down), BootNs(sent - AHEAD_NS + up)))


def arrival(clock: Clock, rng: random.Random, k: int) -> None:
    stamp = BootNs(k * 100 * NS_PER_MS)
    clock.on_arrival(stamp, HostNs(AHEAD_NS + stamp + round(rng.expovariate(0.2) * NS_PER_MS)), "radio")


def garbage(clock: Clock, rng: random.Random, k: int) -> None:
    """Exchanges and arrivals of any instants, over any number of links."""
    sent, trip, boot, heard = (HostNs(rng.randrange(2**bits)) for bits in (62, 34, 62, 62))
    clock.on_exchange(ClockExchange(sent, HostNs(sent + trip), BootNs(boot), link=f"link {k}"))
    clock.on_exchange(
        ClockExchange(HostNs(AHEAD_NS + k * NS_PER_S), HostNs(AHEAD_NS + k * NS_PER_S + trip), BootNs(boot))
    )
    clock.on_arrival(BootNs(boot), heard, f"link {k}")


@pytest.mark.parametrize(
    ("put", "some", "many"),
    [
        pytest.param(exchange, 1_000, 3_000, id="five minutes of exchanges"),
        pytest.param(exchange, 1_000, HOUR, id="an hour of exchanges", marks=pytest.mark.slow),
        pytest.param(arrival, 1_000, HOUR, id="an hour of one-way stamps"),
        pytest.param(garbage, 300, 3_000, id="garbage"),
    ],
)
def test_clock_keeps_no_more_after_many_inputs_than_after_some(put: Input, some: int, many: int):
    clock, rng, sizes = Clock(), random.Random(1), []
    for k in range(many):
        put(clock, rng, k)
        if k == some or k == many - 1:
            sizes.append(reached_bytes(clock))
    assert sizes[1] < 1.3 * sizes[0]
    assert sizes[1] < 100_000


def test_time_line_of_stamps_keeps_no_more_after_an_hour_of_garbage():
    line, rng = BootTimeline(), random.Random(1)
    sizes = []
    for k in range(HOUR):
        line.place(rng.randrange(2**32), HostNs(AHEAD_NS + k * NS_PER_S // 10))
        if k == 1_000 or k == HOUR - 1:
            sizes.append(reached_bytes(line))
    assert sizes[1] < sizes[0] + 2_000
