"""The intake over real sockets, with both clocks controlled by the test."""

import asyncio
import json
import socket
import stat
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from itertools import pairwise
from pathlib import Path

import pytest

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.types import Frame, NoFrame, Reason
from fwav_companion.vision import detections_in
from fwav_companion.vision.detections_in import DetectionsIn, Endpoint
from fwav_companion.vision.frame_receiver import FrameReceiver, read_clocks
from fwav_companion.vision.wall_clock import ClockStep, WallClock

UNIX = 1_790_000_000_000_000_000
PATIENCE_S = 20.0


class Intake:
    """An intake, its events, and its two clocks."""

    def __init__(self, endpoint: Endpoint) -> None:
        self.now = HostNs(500_000_000_000)
        self.unix_minus_host = UNIX
        self.frames: list[Frame | NoFrame] = []
        self.states: list[tuple[bool, str]] = []
        self.steps: list[ClockStep] = []
        receiver = FrameReceiver(
            on_frame=self.frames.append,
            on_step=self.steps.append,
            wall_clock=WallClock(self.now, self.now + UNIX),
            clocks=lambda: (self.now, self.now + self.unix_minus_host),
        )
        self.intake = DetectionsIn(endpoint, receiver, lambda listens, why: self.states.append((listens, why)))

    async def until(self, condition: Callable[[], bool]) -> None:
        async with asyncio.timeout(PATIENCE_S):
            while not condition():  # noqa: ASYNC110  # several callbacks tell it
                await asyncio.sleep(0.002)


class BusyList(list[Frame | NoFrame]):
    """Takes a time on the test's clock for each frame, as the pipeline does."""

    def __init__(self, intake: Intake, takes_ns: int) -> None:
        super().__init__()
        self._intake, self._takes_ns = intake, takes_ns

    def append(self, frame: Frame | NoFrame) -> None:
        super().append(frame)
        self._intake.now = HostNs(self._intake.now + self._takes_ns)


@asynccontextmanager
async def listening(endpoint: Endpoint) -> AsyncIterator[Intake]:
    """An intake that has reported for the first time whether it listens; closed at the end."""
    t = Intake(endpoint)
    t.intake.start()
    try:
        await t.until(lambda: bool(t.states))
        yield t
    finally:
        t.intake.close()


def datagram(time_unix: float) -> bytes:
    return json.dumps({"time_unix": time_unix, "detections": [{"u": 1, "v": 2}]}).encode()


def endpoint_of(kind: str, folder: Path) -> Endpoint:
    return ("127.0.0.1", 0) if kind == "udp" else str(folder / "detections")


def sender_to(intake: DetectionsIn) -> socket.socket:
    address = intake.address
    sock = socket.socket(socket.AF_UNIX if isinstance(address, str) else socket.AF_INET, socket.SOCK_DGRAM)
    sock.connect(address)
    return sock


def test_each_datagram_has_its_own_arrival_time():
    """Frames that wait in one burst are read one after the other: the later arrive later than the earlier's work."""

    async def story() -> None:
        async with listening(("127.0.0.1", 0)) as t:
            t.frames = BusyList(t, 20_000_000)
            t.intake._receiver.on_frame = t.frames.append
            with sender_to(t.intake) as sender:
                for _ in range(5):
                    sender.send(datagram(1_790_000_499.95))
                await t.until(lambda: len(t.frames) == 5)
            arrivals = [frame.arrival_ns for frame in t.frames if isinstance(frame, Frame)]
            assert [b - a for a, b in pairwise(arrivals)] == [20_000_000] * 4

    asyncio.run(story())


@pytest.mark.parametrize("kind", ["udp", "unix"])
def test_a_datagram_is_a_frame_and_garbage_is_a_reason(kind: str, tmp_path: Path):
    async def story() -> None:
        async with listening(endpoint_of(kind, tmp_path)) as t:
            assert t.states == [(True, "")]
            with sender_to(t.intake) as sender:
                for data in (datagram(1_790_000_499.95), b"garbage", b"", datagram(1_790_000_499.98)):
                    sender.send(data)
                await t.until(lambda: len(t.frames) == 4)
            first, second, third, fourth = t.frames
            assert isinstance(first, Frame)
            assert (first.stamp_ns, first.arrival_ns) == (499_950_000_000, t.now)
            assert isinstance(second, NoFrame)
            assert isinstance(third, NoFrame)
            assert second.reason is third.reason is Reason.MALFORMED
            assert isinstance(fourth, Frame)
        assert t.intake.address is None

    asyncio.run(story())


def test_a_step_of_the_wall_clock_is_noticed_with_the_datagram_that_crosses_it():
    async def story() -> None:
        async with listening(("127.0.0.1", 0)) as t:
            with sender_to(t.intake) as sender:
                t.unix_minus_host += 5_000_000_000
                sender.send(datagram(1_790_000_499.98))
                await t.until(lambda: len(t.frames) == 1)
            assert isinstance(t.frames[0], NoFrame)
            assert t.frames[0].reason is Reason.ACROSS_CLOCK_STEP
            assert [step.size_s for step in t.steps] == [5.0]

    asyncio.run(story())


def test_a_datagram_that_is_too_long_is_malformed_not_cut(tmp_path: Path):
    async def story() -> None:
        async with listening(str(tmp_path / "detections")) as t:
            with sender_to(t.intake) as sender:
                sender.send(datagram(1_790_000_499.95) + b" " * 65536)
                await t.until(lambda: len(t.frames) == 1)
            assert isinstance(t.frames[0], NoFrame)
            assert t.frames[0].reason is Reason.MALFORMED

    asyncio.run(story())


def test_what_a_killed_process_left_is_replaced_and_nothing_is_left_by_us(tmp_path: Path):
    path = tmp_path / "detections"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as left_over:
        left_over.bind(str(path))

    async def story() -> None:
        async with listening(str(path)) as t:
            assert t.states == [(True, "")]
            assert stat.S_IMODE(path.stat().st_mode) == 0o660
        assert not path.exists()

    asyncio.run(story())


def test_a_path_that_another_process_listens_on_is_left_to_it(tmp_path: Path):
    path = tmp_path / "detections"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as other:
        other.bind(str(path))

        async def story() -> None:
            async with listening(str(path)) as t:
                assert t.states == [(False, "Address already in use")]

        asyncio.run(story())
        assert path.exists()


def test_a_file_in_the_way_is_not_deleted(tmp_path: Path):
    path = tmp_path / "detections"
    path.write_text("mine")

    async def story() -> None:
        async with listening(str(path)) as t:
            assert t.states == [(False, "Address already in use")]

    asyncio.run(story())
    assert path.read_text() == "mine"


def test_a_folder_that_comes_later_and_a_socket_that_is_deleted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(detections_in, "RETRY_S", 0.01)
    path = tmp_path / "later" / "detections"

    async def story() -> None:
        async with listening(str(path)) as t:
            await asyncio.sleep(0.05)
            assert t.states == [(False, "No such file or directory")], "reported once"
            path.parent.mkdir()
            await t.until(lambda: len(t.states) == 2)
            path.unlink()
            await t.until(path.exists)
            with sender_to(t.intake) as sender:
                sender.send(datagram(1_790_000_499.95))
                await t.until(lambda: len(t.frames) == 1)
            assert [listens for listens, _ in t.states] == [False, True]

    asyncio.run(story())


def test_a_taken_port_is_tried_again(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(detections_in, "RETRY_S", 0.01)

    async def story() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.bind(("127.0.0.1", 0))
            t = Intake(other.getsockname())
            t.intake.start()
            await t.until(lambda: bool(t.states))
        await t.until(lambda: len(t.states) == 2)
        assert t.states == [(False, "Address already in use"), (True, "")]
        t.intake.close()

    asyncio.run(story())


def test_an_unknown_host_is_reported_in_words(monkeypatch: pytest.MonkeyPatch):
    def look_up(*_args: object, **_kwargs: object) -> object:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", look_up)

    async def story() -> None:
        t = Intake(("nowhere.invalid", 14601))
        t.intake.start()
        await t.until(lambda: bool(t.states))
        assert t.states == [(False, "no such host: nowhere.invalid")]
        t.intake.close()

    asyncio.run(story())


def test_both_clocks_are_read_at_one_instant():
    host_ns, unix_ns = read_clocks()
    again_ns, unix_again_ns = read_clocks()
    assert host_ns % 1000 == 0
    assert 0 <= again_ns - host_ns < 60_000_000_000
    assert abs((unix_again_ns - again_ns) - (unix_ns - host_ns)) < 50_000_000
