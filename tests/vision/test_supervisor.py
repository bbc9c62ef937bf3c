"""The vision process under the daemon: tags arrive; a crash, silence or absence is survived and reported once."""

import asyncio
import json
import os
import resource
import signal
import socket
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest
from vision_pictures import pipe_bytes, tag_picture

from fwav_companion.types import Frame
from fwav_companion.types.status import VisionReport
from fwav_companion.vision import supervisor
from fwav_companion.vision.frame_receiver import FrameReceiver, read_clocks
from fwav_companion.vision.supervisor import VisionProcess
from fwav_companion.vision.task import VisionOrders, VisionState, VisionTask
from fwav_companion.vision.wall_clock import WallClock


class Daemon:
    """Keeps the output of the vision process."""

    def __init__(self, task: VisionTask, kept: int = 0) -> None:
        self.frames: list[Frame] = []
        self.states: list[tuple[bool, str]] = []
        self.changed = asyncio.Event()
        receiver = FrameReceiver(self._frame, lambda step: None, WallClock(*read_clocks()))
        self.pictures: list[tuple[bytes, bytes]] = []
        self.process = VisionProcess(task, receiver, self._state, self, kept=kept)

    def _frame(self, frame) -> None:
        self.frames.append(frame)
        self.changed.set()

    def on_picture(self, data: bytes, jpeg: bytes) -> None:
        self.pictures.append((data, jpeg))
        self.changed.set()

    def _state(self, report: VisionReport) -> None:
        self.states.append((report.works, report.why))
        self.changed.set()

    async def until(self, true, timeout_s: float = 20.0) -> None:
        async with asyncio.timeout(timeout_s):
            while not true():
                self.changed.clear()
                await self.changed.wait()


def feed(path: Path, pictures: list[bytes], go_on: threading.Event) -> threading.Thread:
    """Writes pictures into a named pipe from another thread, and closes it when signalled."""

    def write() -> None:
        with suppress(BrokenPipeError), path.open("wb") as file:  # the reader may die of a picture
            for picture in pictures:
                file.write(picture)
            file.flush()
            go_on.wait(20.0)

    thread = threading.Thread(target=write, daemon=True)
    thread.start()
    return thread


def number_in(path: str) -> int:
    """The first number in a file of the kernel's."""
    return int(Path(path).read_text().split()[0])


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(supervisor, "FIRST_RETRY_S", 0.05)
    monkeypatch.setattr(supervisor, "LOOK_S", 0.05)


def test_tags_are_found_in_the_process_and_its_death_is_survived(tmp_path: Path, quick):
    path = tmp_path / "frames"
    os.mkfifo(path)

    async def watch() -> Daemon:
        daemon = Daemon(VisionTask(str(path)), kept=1)
        daemon.process.start()
        leave = threading.Event()
        picture = tag_picture((200.0, 120.0))
        first = feed(path, [pipe_bytes(picture, time_monotonic=1.0 + i, frame=i) for i in range(1)], leave)
        await daemon.until(lambda: len(daemon.frames) == 1 and daemon.pictures)
        os.kill(daemon.process.status().pid, signal.SIGKILL)
        leave.set()
        await daemon.until(lambda: daemon.states and not daemon.states[-1][0])
        await asyncio.to_thread(first.join, 5.0)
        leave = threading.Event()
        second = feed(path, [pipe_bytes(picture, time_monotonic=9.0, frame=9)], leave)
        await daemon.until(lambda: len(daemon.frames) == 2 and len(daemon.pictures) == 2)
        assert daemon.process.status().deaths == 1
        daemon.process.close()
        leave.set()
        await asyncio.to_thread(second.join, 5.0)
        return daemon

    daemon = asyncio.run(watch())
    assert [frame.number for frame in daemon.frames] == [0, 9]
    assert [frame.stamp_ns for frame in daemon.frames] == [1_000_000_000, 9_000_000_000]
    for frame in daemon.frames:
        assert frame.size == (640, 480)
        (detection,) = frame.detections
        assert detection.label == "tag36h11:7"
        assert (detection.u, detection.v) == pytest.approx((200.0, 120.0), abs=0.3)
    for (data, jpeg), number in zip(daemon.pictures, (0, 9), strict=True):
        assert json.loads(data)["frame"] == number
        shown = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE)
        assert np.abs(shown.astype(float) - tag_picture((200.0, 120.0))).mean() < 1.5
    assert [works for works, _ in daemon.states] == [True, False, True]
    assert "SIGKILL" in daemon.states[1][1]


def test_a_process_without_memory_ends_and_another_finds_the_tags(tmp_path: Path, quick):
    """Its address space is as large as it may become: the next picture does not fit. The first to go is the camera."""
    path = tmp_path / "frames"
    os.mkfifo(path)

    async def watch() -> Daemon:
        daemon = Daemon(VisionTask(str(path)))
        daemon.process.start()
        leave = threading.Event()
        first = feed(path, [pipe_bytes(tag_picture(), time_monotonic=1.0)], leave)
        await daemon.until(lambda: len(daemon.frames) == 1)
        pid = daemon.process.status().pid
        assert number_in(f"/proc/{pid}/oom_score_adj") > number_in("/proc/self/oom_score_adj")
        size = number_in(f"/proc/{pid}/statm") * resource.getpagesize()
        resource.prlimit(pid, resource.RLIMIT_AS, (size, size))
        leave.set()
        await asyncio.to_thread(first.join, 5.0)
        leave = threading.Event()
        huge = cv2.resize(tag_picture(), (6000, 4500))
        pictures = [pipe_bytes(huge, time_monotonic=2.0), pipe_bytes(tag_picture(), time_monotonic=9.0, frame=9)]
        writers = [feed(path, [pictures[0]], leave)]
        await daemon.until(lambda: daemon.process.status().deaths == 1)
        writers.append(feed(path, [pictures[1]], leave))
        await daemon.until(lambda: any(frame.number == 9 for frame in daemon.frames))
        assert daemon.process.status().pid != pid
        daemon.process.close()
        leave.set()
        for writer in writers:
            await asyncio.to_thread(writer.join, 5.0)
        return daemon

    daemon = asyncio.run(watch())
    assert False in [works for works, _ in daemon.states]
    assert daemon.states[-1][0]


def test_a_missing_source_is_reported_once_and_taken_when_it_comes(tmp_path: Path, quick):
    path = tmp_path / "frames"

    async def watch() -> Daemon:
        daemon = Daemon(VisionTask(str(path)))
        daemon.process.start()
        await daemon.until(lambda: bool(daemon.states))
        await asyncio.sleep(2.5)  # it checks again several times, and reports nothing new
        assert len(daemon.states) == 1
        os.mkfifo(path)
        leave = threading.Event()
        writer = feed(path, [pipe_bytes(tag_picture(), time_monotonic=1.0)], leave)
        await daemon.until(lambda: bool(daemon.frames))
        daemon.process.close()
        leave.set()
        await asyncio.to_thread(writer.join, 5.0)
        return daemon

    daemon = asyncio.run(watch())
    assert [works for works, _ in daemon.states] == [False, True]
    assert "No such file" in daemon.states[0][1]


def test_a_process_that_hangs_is_ended_and_another_started(tmp_path: Path, quick, monkeypatch):
    path = tmp_path / "frames"
    os.mkfifo(path)
    leave = threading.Event()

    async def watch() -> Daemon:
        daemon = Daemon(VisionTask(str(path)))
        daemon.process.start()
        writer = feed(path, [pipe_bytes(tag_picture(), time_monotonic=1.0)], leave)
        await daemon.until(lambda: bool(daemon.frames))
        hanging = daemon.process.status().pid
        os.kill(hanging, signal.SIGSTOP)
        monkeypatch.setattr(supervisor, "SILENCE_S", 0.2)
        await daemon.until(lambda: daemon.states[-1][0] is False)
        monkeypatch.setattr(supervisor, "SILENCE_S", 15.0)
        leave.set()
        await asyncio.to_thread(writer.join, 5.0)
        await asyncio.sleep(0.3)
        second = daemon.process.status().pid
        assert second not in (None, hanging)
        daemon.process.restart()
        while daemon.process.status().pid in (None, second):  # noqa: ASYNC110  # no event says it
            await asyncio.sleep(0.05)
        daemon.process.close()
        with pytest.raises(ProcessLookupError):
            os.kill(hanging, 0)
        return daemon

    daemon = asyncio.run(watch())
    assert "silent" in daemon.states[1][1]


def test_closing_takes_no_time_and_leaves_no_process(tmp_path: Path):
    async def watch() -> int:
        daemon = Daemon(VisionTask(str(tmp_path / "frames")))
        daemon.process.start()
        await daemon.until(lambda: bool(daemon.states))
        pid = daemon.process.status().pid
        before = asyncio.get_running_loop().time()
        daemon.process.close()
        assert asyncio.get_running_loop().time() - before < 1.0
        return pid

    pid = asyncio.run(watch())
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


def test_the_process_ends_with_a_daemon_that_was_killed(tmp_path: Path):
    code = (
        "import asyncio, os, sys; sys.path.insert(0, sys.argv[1]);"
        "from test_supervisor import Daemon, VisionTask\n"
        "async def watch():\n"
        "    daemon = Daemon(VisionTask(sys.argv[2]))\n"
        "    daemon.process.start()\n"
        "    await daemon.until(lambda: bool(daemon.states))\n"
        "    print(daemon.process.status().pid, flush=True)\n"
        "    os.kill(os.getpid(), 9)\n"
        "asyncio.run(watch())"
    )
    command = [sys.executable, "-c", code, str(Path(__file__).parent), str(tmp_path / "frames")]
    done = subprocess.run(command, stdout=subprocess.PIPE, timeout=30)
    pid = int(done.stdout)
    for _ in range(200):
        try:
            os.kill(pid, 0)
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except (ProcessLookupError, FileNotFoundError):
            return
        if state == "Z":  # ended; the process that adopts orphans has not collected it yet
            return
        threading.Event().wait(0.05)
    pytest.fail("the vision process outlived its daemon")


def command_line(pid: int) -> str:
    """What every user of the machine can read of a process."""
    return Path(f"/proc/{pid}/cmdline").read_text()


def test_passwords_are_neither_on_the_command_line_nor_in_what_the_process_reports(quick):
    """A stream on a port without a server: the library quotes the whole URL in its error."""
    url = "rtsp://pilot:p4ssw0rd@127.0.0.1:9/live"
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]

    async def watch() -> tuple[str, str]:
        daemon = Daemon(VisionTask(url, detector="none", preview=f"127.0.0.1:{port}/t0ken"))
        daemon.process.start()
        await daemon.until(lambda: any("127.0.0.1:9" in why for _, why in daemon.states))
        line = command_line(daemon.process.status().pid)
        daemon.process.close()
        return line, daemon.states[-1][1]

    line, why = asyncio.run(watch())
    assert "fwav_companion.vision.worker" in line
    assert [text for text in ("p4ssw0rd", "t0ken", "rtsp") if text in line] == []
    assert "p4ssw0rd" not in why


def test_want_of_memory_is_one_state_and_no_trace():
    """A process whose detector finds no memory: it says so and ends, for the daemon to start another."""
    code = (
        "import resource, sys; from fwav_companion.vision import worker\n"
        "from fwav_companion.memory_limit import MOST_VISION\n"
        "def watch(self):\n"
        "    assert resource.getrlimit(resource.RLIMIT_DATA)[0] <= MOST_VISION\n"
        "    raise MemoryError\n"
        "worker.Watch.watch = watch\n"
        "worker.main()"
    )
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        ours.settimeout(30.0)
        ours.send(msgspec.json.encode(VisionOrders(VisionTask("unused"), 0)))
        command = [sys.executable, "-c", code, str(theirs.fileno())]
        with subprocess.Popen(command, pass_fds=[theirs.fileno()], stderr=subprocess.PIPE) as process:
            state = msgspec.json.decode(ours.recv(65536), type=VisionState)
            _, trace = process.communicate(timeout=30)
    assert (state.vision, state.why) == ("lost", "out of memory: a smaller picture or model is needed")
    assert process.returncode == 12
    assert trace == b""
