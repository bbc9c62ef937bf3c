"""Picture sources: what arrives, what is refused with a clear reason, and what ends."""

import json
import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from vision_pictures import pipe_bytes

from fwav_companion.vision.images import SourceEndedError, SourceLostError
from fwav_companion.vision.sources import open_source as open_task
from fwav_companion.vision.sources.folder import FolderSource
from fwav_companion.vision.sources.pipe import PipeSource
from fwav_companion.vision.task import VisionTask


def open_source(text: str):
    return open_task(VisionTask(text))


GREY = np.arange(12 * 16, dtype=np.uint8).reshape(12, 16)
COLOURED = np.stack([GREY, GREY // 2, 255 - GREY], axis=-1)


class Clock:
    """Time that passes only in sleep, so that a busy machine is never late."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.now_s += seconds


class Writer:
    """The other end of a named pipe."""

    def __init__(self, path: Path) -> None:
        os.mkfifo(path)
        self.source = PipeSource(path)
        self.file = os.open(path, os.O_WRONLY | os.O_NONBLOCK)

    def write(self, data: bytes) -> None:
        assert os.write(self.file, data) == len(data)

    def close(self) -> None:
        os.close(self.file)


@pytest.fixture
def pipe(tmp_path: Path):
    writer = Writer(tmp_path / "frames")
    yield writer
    writer.source.close()


def test_pictures_come_through_a_pipe_in_pieces(pipe: Writer):
    data = pipe_bytes(GREY, time_monotonic=12.5, frame=3, exposure_s=0.004) + pipe_bytes(COLOURED, time_boot=1.0)
    assert isinstance(pipe.source, PipeSource)
    for start in range(0, len(data) - 1, 100):
        pipe.write(data[start : min(start + 100, len(data) - 1)])
        if start == 0:
            assert pipe.source.read(0.0) is None
    first = pipe.source.read(0.0)
    assert (first.pixels == GREY).all()
    assert (first.stamp, first.number, first.exposure_s) == ({"time_monotonic": 12.5}, 3, 0.004)
    assert pipe.source.read(0.0) is None
    pipe.write(data[-1:])
    second = pipe.source.read(0.0)
    assert (second.pixels == COLOURED).all()
    assert (second.stamp, second.number, second.exposure_s) == ({"time_boot": 1.0}, None, None)
    pipe.close()
    with pytest.raises(SourceLostError, match="closed it"):
        pipe.source.read(0.0)


@pytest.mark.parametrize(
    ("data", "reported"),
    [
        (b"x" * 5000, "without its line of JSON"),
        (b"[1]\n", "not a JSON object"),
        (b"{\n", "not a JSON object"),
        (b'{"size": [4, 4], "format": "mjpeg"}\n', "gray8 or bgr8"),
        (b'{"size": [4, -4], "format": "gray8"}\n', "size"),
        (b'{"size": [400000, 400000], "format": "gray8"}\n', "size"),
        (b'{"size": [1, 1], "format": "gray8"}\nx', "exactly one of"),
        (b'{"size": [1, 1], "format": "gray8", "time_unix": 1, "time_boot": 2}\nx', "exactly one of"),
        (b'{"size": [1, 1], "format": "gray8", "time_unix": NaN}\nx', "exactly one of"),
    ],
)
def test_what_is_no_picture_closes_the_pipe_by_a_clear_word(pipe: Writer, data: bytes, reported: str):
    pipe.write(data)
    with pytest.raises(SourceLostError, match=reported):
        pipe.source.read(0.0)
    pipe.close()


def test_a_folder_is_followed_as_it_grows(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    lines = (tmp_path / "stamps.jsonl").open("w")

    def shoot(number: int) -> str:
        cv2.imwrite(str(tmp_path / f"{number}.png"), GREY + number)
        return json.dumps({"file": f"{number}.png", "time_unix": 1.79e9 + number, "frame": number})

    print(shoot(0), file=lines, flush=True)
    source = open_source(str(tmp_path))
    assert isinstance(source, FolderSource)
    first = source.read(0.0)
    assert first.stamp == {"time_unix": 1.79e9}
    assert (first.pixels[:, :, 0] == GREY).all()
    line = shoot(1)
    lines.write(line[:20])
    lines.flush()
    assert source.read(0.0) is None
    print(line[20:], file=lines, flush=True)
    assert source.read(0.0).number == 1
    print(json.dumps({"file": "../../etc/passwd", "time_unix": 1.0}), file=lines, flush=True)
    print("[" * 9999, file=lines)
    print('{"file": "1.png", "time_unix": 1' + "0" * 400 + "}", file=lines)
    print(shoot(2), file=lines, flush=True)
    assert source.read(5.0).number == 2, "what is damaged keeps nothing behind it away"
    assert caplog.text.count("not a readable picture: skipped") == 1
    (tmp_path / "stamps.jsonl").unlink()
    with pytest.raises(SourceLostError, match="removed"):
        source.read(0.0)
    source.close()
    lines.close()


def test_a_truncated_jpeg_in_a_folder_is_left_out(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    noise = np.random.default_rng(1).integers(0, 255, (48, 64), np.uint8)
    whole = cv2.imencode(".jpg", noise)[1].tobytes()
    lines = []
    for number, data in enumerate((whole, b"", whole[:20], whole)):
        (tmp_path / f"{number}.jpg").write_bytes(data)
        lines.append(json.dumps({"file": f"{number}.jpg", "time_unix": 1.0 + number, "frame": number}))
    (tmp_path / "stamps.jsonl").write_text("\n".join(lines) + "\n")
    source = open_source(str(tmp_path))
    assert [source.read(5.0).number for _ in range(2)] == [0, 3]
    assert caplog.text.count("skipped;") == 1
    source.close()


def test_pictures_that_change_their_size_keep_their_own(pipe: Writer):
    pipe.write(pipe_bytes(GREY, time_monotonic=1.0) + pipe_bytes(COLOURED[:6, :8].copy(), time_monotonic=2.0))
    assert [pipe.source.read(0.0).pixels.shape for _ in range(2)] == [(12, 16), (6, 8, 3)]
    pipe.close()


def test_lines_that_begin_again_are_read_again(tmp_path: Path):
    """A camera program that is started again opens its file for writing, and the file keeps its inode."""
    cv2.imwrite(str(tmp_path / "0.png"), GREY)
    lines, line = tmp_path / "stamps.jsonl", json.dumps({"file": "0.png", "time_unix": 1.0}) + "\n"
    lines.write_text(2 * line)
    source = open_source(str(tmp_path))
    assert all(source.read(0.0) is not None for _ in range(2))
    lines.write_text(line)
    with pytest.raises(SourceLostError, match="replaced"):
        source.read(0.0)
    source.close()


def test_a_video_plays_to_its_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    clock, path = Clock(), tmp_path / "flight.avi"
    monkeypatch.setattr("fwav_companion.vision.sources.capture.time", clock)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 50.0, (64, 48))
    for level in (30, 90, 150):
        writer.write(np.full((48, 64, 3), level, np.uint8))
    writer.release()
    source = open_source(str(path))
    pictures = [source.read(1.0) for _ in range(3)]
    assert [round(float(picture.pixels.mean()), -1) for picture in pictures] == [30, 90, 150]
    stamps = [picture.stamp["time_monotonic"] for picture in pictures]
    assert stamps == pytest.approx([100.0, 100.02, 100.04], abs=1e-6)
    assert clock.now_s == pytest.approx(100.04, abs=1e-6)
    with pytest.raises(SourceEndedError):
        source.read(1.0)
    source.close()


@pytest.mark.parametrize(
    ("text", "reported"),
    [
        ("/nowhere/at/all", "No such file"),
        ("/dev/video977", "it does not exist"),
        ("libcamera:0", "picamera2"),
        ("/dev/null", "cannot be opened"),
    ],
)
def test_what_is_not_there_is_lost_and_not_a_crash(text: str, reported: str):
    with pytest.raises(SourceLostError, match=reported):
        open_source(text)


def test_a_folder_without_stamps_says_what_is_missing(tmp_path: Path):
    with pytest.raises(SourceLostError, match=r"stamps\.jsonl: No such file .* a line per picture: \{"):
        open_source(str(tmp_path))
