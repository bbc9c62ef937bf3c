"""The queue of frames before the pipeline: nothing waits for long behind it, and under overload the newest is kept."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from itertools import pairwise

import pytest

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.types import NoticeCode
from fwav_companion.vision import frame_queue
from fwav_companion.vision.frame_queue import LEAST_REPORTED, MOST_WAITING, PATIENCE_S, FrameQueue


class Processor:
    """Takes datagrams, each for a time by a clock of its own, which the queue reads too."""

    def __init__(self, backlog: Callable[[], int] = lambda: 0):
        self.now_s, self.cost_s = 1000.0, 0.0
        self.taken: list[int] = []
        self.dropped = 0
        self.queue = FrameQueue(self._take, self._drop, backlog, lambda: self.now_s)

    def put(self, *numbers: int) -> None:
        for number in numbers:
            self.queue.put(str(number).encode())

    def _take(self, data: bytes) -> None:
        self.taken.append(int(data))
        self.now_s += self.cost_s

    def _drop(self) -> None:
        self.dropped += 1


async def turns(count: int) -> None:
    for _ in range(count):
        await asyncio.sleep(0)


@pytest.fixture
def processor() -> Processor:
    return Processor()


def test_a_frame_is_taken_at_once_where_none_waits(processor: Processor):
    async def story() -> None:
        processor.put(1)
        assert processor.taken == [1]
        await turns(3)
        processor.put(2)
        assert processor.taken == [1, 2]

    asyncio.run(story())


def test_a_burst_of_cheap_frames_is_taken_whole_and_in_order(processor: Processor):
    async def story() -> None:
        processor.put(*range(30))
        await turns(3)
        assert processor.taken == list(range(30))
        assert processor.dropped == 0

    asyncio.run(story())


def test_a_burst_of_costly_frames_is_taken_one_a_turn(processor: Processor):
    """Whatever else is ready has its turn in between."""
    processor.cost_s = 0.02

    async def story() -> None:
        processor.put(*range(4))
        seen = []
        for _ in range(8):
            seen.append(len(processor.taken))
            await turns(1)
        assert processor.taken == [0, 1, 2, 3]
        assert max(b - a for a, b in pairwise(seen)) == 1

    asyncio.run(story())


def test_frames_faster_than_the_processor_are_dropped_and_the_newest_is_taken(processor: Processor):
    """Ten times as many as it can take; a quarter of a second passes before it shows."""
    processor.cost_s = 0.04
    late_s = []

    async def story() -> None:
        sent, next_s = 0, processor.now_s
        while sent < 2000:
            before = len(processor.taken)
            while next_s <= processor.now_s:  # what came while the last one was processed
                processor.put(sent)
                sent, next_s = sent + 1, next_s + 0.004
            await turns(1)
            if len(processor.taken) > before:
                late_s.append((sent - 1 - processor.taken[-1]) * 0.004)
        await turns(40)
        assert processor.taken[-1] == sent - 1
        assert len(processor.taken) + processor.dropped == sent == processor.queue.came

    asyncio.run(story())
    assert processor.taken == sorted(processor.taken)
    assert len(processor.taken) > 150, "it is busy all the time"
    assert max(late_s[20:]) < 0.1, "the newest are taken, not the oldest that fit"


def test_where_the_processor_keeps_up_nothing_is_dropped(processor: Processor):
    """A camera at 30 Hz, 20 ms each; every second frame comes with its predecessor."""
    processor.cost_s = 0.02

    async def story() -> None:
        for k in range(0, 200, 2):
            processor.put(k, k + 1)
            for _ in range(4):
                await turns(1)
            processor.now_s = max(processor.now_s, 1000.0 + (k + 2) / 30.0)

    asyncio.run(story())
    assert processor.taken == list(range(200))


def test_overload_ends_with_the_last_frame_that_waits(processor: Processor):
    async def story() -> None:
        processor.put(0)
        processor.put(1, 2, 3)
        processor.now_s += PATIENCE_S + 0.01
        await turns(4)
        assert (processor.taken, processor.dropped) == ([0, 3], 2)
        processor.put(4)
        processor.put(5, 6, 7)
        await turns(4)
        assert processor.taken == [0, 3, 4, 5, 6, 7]

    asyncio.run(story())


def test_frames_are_held_back_while_those_in_the_pipeline_would_take_too_long(monkeypatch: pytest.MonkeyPatch):
    backlog = [0]
    processor = Processor(lambda: backlog[0])
    monkeypatch.setattr(frame_queue, "HELD_S", 0.0)

    async def story() -> None:
        for _ in range(100):
            processor.queue.spent(0.256, 256)  # a millisecond each
        backlog[0] = 99
        processor.put(0)
        await turns(2)
        backlog[0] = 101
        processor.put(*range(1, 60))
        await turns(20)
        assert processor.taken == [0]
        assert processor.dropped == 59 - MOST_WAITING
        backlog[0] = 0
        await turns(100)
        assert processor.taken == [0, 59], "the newest"

    asyncio.run(story())


def test_an_error_in_one_frame_does_not_stop_the_others():
    taken: list[bytes] = []

    def take(data: bytes) -> None:
        taken.append(data)
        if data == b"bad":
            raise ValueError

    async def story() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda *_: None)
        queue = FrameQueue(take, lambda: None)
        queue.put(b"first")
        queue.put(b"bad")
        queue.put(b"last")
        await turns(5)
        assert taken == [b"first", b"bad", b"last"]

    asyncio.run(story())


def test_what_was_dropped_is_reported_once_a_minute(processor: Processor):
    async def overloaded(first: int, count: int) -> None:
        processor.put(first)
        processor.put(*range(first + 1, first + count))
        processor.now_s += 1.0
        await turns(4)

    async def story() -> None:
        await overloaded(0, LEAST_REPORTED)
        assert processor.queue.dropped == LEAST_REPORTED - 2
        assert processor.queue.notices(HostNs(NS_PER_S)) == []
        await overloaded(100, 4)
        (notice,) = processor.queue.notices(HostNs(NS_PER_S))
        assert notice.code is NoticeCode.OVERLOAD
        assert f"{LEAST_REPORTED} of {LEAST_REPORTED + 4}" in notice.text
        assert processor.queue.notices(HostNs(200 * NS_PER_S)) == []
        await overloaded(200, LEAST_REPORTED + 2)
        assert processor.queue.notices(HostNs(60 * NS_PER_S)) == []
        (again,) = processor.queue.notices(HostNs(61 * NS_PER_S))
        assert f"{LEAST_REPORTED} of {LEAST_REPORTED + 2}" in again.text

    asyncio.run(story())
