"""Files, folders and a video, and what is wrong with them."""

import struct
import zlib
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest
from draws import first_of

from fwav_companion.errors import InputFileError
from fwav_companion.tools.calibrate.board_spec import parse_board
from fwav_companion.tools.calibrate.board_views import find_board
from fwav_companion.tools.calibrate.pictures import (
    MOST_PICTURES,
    VIDEO_PIECES,
    pictures_of,
    same_size,
    sharpest_frames,
    silence_opencv,
)

BOARD = parse_board("chessboard:7x5:25mm")


@contextmanager
def unwatched(_told, _total):
    yield lambda: None


def pictures(names):
    return pictures_of(names, unwatched)[0]


@pytest.fixture(autouse=True)
def quiet():
    silence_opencv()


def grey_picture(path, size=(64, 48), level=100):
    cv2.imwrite(str(path), np.full((size[1], size[0]), level, np.uint8))
    return path


def names(taken):
    return [shot.name for shot in taken]


def test_files_in_the_order_given_and_folders_by_name(tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    b, a = grey_picture(folder / "b.png"), grey_picture(folder / "a.JPG")
    (folder / "notes.txt").write_text("none")
    alone = grey_picture(tmp_path / "alone.png")
    assert names(pictures([str(alone), str(folder)])) == [str(alone), str(a), str(b)]


def test_a_picture_may_be_called_anything(tmp_path):
    picture = grey_picture(tmp_path / "frame.png").rename(tmp_path / "frame.0001")
    (shot,) = pictures([str(picture)])
    assert shot.read().shape == (48, 64)


def test_of_very_many_some_are_taken_evenly(tmp_path):
    for i in range(MOST_PICTURES + 50):
        grey_picture(tmp_path / f"{i:04d}.pgm", (8, 8))
    shown, left_out = pictures_of([str(tmp_path)], unwatched)
    taken = names(shown)
    assert left_out == f"{MOST_PICTURES} of {MOST_PICTURES + 50} pictures are used, evenly spaced"
    assert len(taken) == len(set(taken)) == MOST_PICTURES
    assert taken[0].endswith("0000.pgm")
    assert taken[-1].endswith(f"{MOST_PICTURES + 49:04d}.pgm")


def test_a_turn_that_is_only_noted_in_the_file_is_not_carried_out(tmp_path):
    """Orientation 6 of EXIF: a viewer shows it as 48 wide, 64 high; the sensor has 64 by 48."""
    plain = grey_picture(tmp_path / "plain.jpg").read_bytes()
    entry = b"\x01\x12\x00\x03\x00\x00\x00\x01\x00\x06\x00\x00"
    exif = b"Exif\x00\x00MM\x00*\x00\x00\x00\x08\x00\x01" + entry + b"\x00\x00\x00\x00"
    turned = tmp_path / "turned.jpg"
    turned.write_bytes(plain[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + plain[2:])
    assert cv2.imread(str(turned), cv2.IMREAD_GRAYSCALE).shape == (64, 48)
    (shot,) = pictures([str(turned)])
    assert shot.read().shape == (48, 64)


@pytest.fixture
def video(tmp_path):
    """A video in which the second of each three frames is sharp."""
    path = tmp_path / "board.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 30.0, (64, 48))
    rng = np.random.default_rng(1)
    for i in range(3 * VIDEO_PIECES):
        crisp = rng.integers(0, 255, (48, 64, 3), np.uint8)
        writer.write(crisp if i % 3 == 1 else cv2.blur(crisp, (9, 9)))
    writer.release()
    return path


def test_of_a_video_the_sharpest_frame_of_each_piece(video):
    taken = pictures([str(video)])
    assert names(taken) == [f"{video}, frame {3 * i + 1}" for i in range(VIDEO_PIECES)]
    assert taken[0].read().shape == (48, 64)


def test_a_video_that_counts_its_frames_wrongly_is_read_all_the_same(video):
    for said in (1, 100 * VIDEO_PIECES):
        found, frames = sharpest_frames(Path(video), said, lambda: None)
        assert frames == 3 * VIDEO_PIECES
        assert 1 <= len(found) <= VIDEO_PIECES
        assert any(number % 3 == 1 for number, _ in found)


def refusal(paths, match):
    with pytest.raises(InputFileError, match=match) as caught:
        same_size(pictures([str(path) for path in paths]), lambda _shot, _grey: None)
    assert "\n" not in str(caught.value)


def test_what_is_not_there_or_no_picture(tmp_path, video):
    text, empty, damaged = tmp_path / "text.txt", tmp_path / "empty.png", tmp_path / "damaged.png"
    text.write_text("words")
    empty.write_bytes(b"")
    damaged.write_bytes(grey_picture(tmp_path / "whole.png").read_bytes()[:40])
    (tmp_path / "folder").mkdir()
    refusal([tmp_path / "none.png"], "none.png: No such file")
    refusal([tmp_path / "folder"], "no picture in this folder")
    refusal([text], "text.txt: not a readable picture or video")
    refusal([empty], "empty.png: not a readable picture or video")
    refusal([damaged], "damaged.png: ")
    whole = grey_picture(tmp_path / "whole.jpg").read_bytes()
    (tmp_path / "cut.jpg").write_bytes(whole[: whole.rindex(b"\xff\xda") + 30])
    refusal([tmp_path / "cut.jpg"], "cut.jpg: a damaged picture")
    refusal([tmp_path / "whole.png", text], "text.txt: not a readable picture; accepted: .*, alone")
    refusal([video, tmp_path / "whole.png"], "board.avi: not a readable picture; accepted: .*, alone")


def png_of_size(width, height):
    """A PNG whose header claims this size, with hardly any pixels."""
    chunks = [
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)),
        (b"IDAT", zlib.compress(bytes(100))),
        (b"IEND", b""),
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    )


@pytest.mark.parametrize("size", [(0, 0), (100_000, 100_000)])
def test_a_decoder_that_complains_says_nothing_of_its_own(size, tmp_path, capfd):
    (tmp_path / "odd.png").write_bytes(png_of_size(*size))
    refusal([tmp_path / "odd.png"], "odd.png: a damaged picture, or one too large")
    assert capfd.readouterr().err == ""


def test_pictures_of_two_sizes(tmp_path):
    one, other = grey_picture(tmp_path / "1.png"), grey_picture(tmp_path / "2.png", (48, 64))
    refusal([one, other], r"2.png: 48 x 64 pixels; accepted: 64 x 48 as .*1.png")


def test_looking_names_every_picture(chess_folder, tmp_path):
    tiny = grey_picture(tmp_path / "dull.png", (320, 240))
    taken = pictures([str(tiny), str(chess_folder)])[:3]
    looked = find_board(taken, BOARD, lambda _known: None)
    assert looked.size == (320, 240)
    assert looked.unused == {str(tiny): "board not seen"}
    assert [view.name for view in looked.views] == names(taken)[1:]
    assert all(len(view.pixels) == 35 for view in looked.views)


def test_a_picture_too_small_for_any_board_shows_none(tmp_path):
    looked = find_board(pictures([str(grey_picture(tmp_path / "1.png", (1, 1)))]), BOARD, lambda _known: None)
    assert (looked.views, len(looked.unused)) == ((), 1)


def test_copies_of_a_view_count_once(chess_folder, tmp_path):
    for i in range(3):  # the same moment, another noise
        picture = cv2.imread(str(chess_folder / "00.png"), cv2.IMREAD_GRAYSCALE)
        grain = np.random.default_rng(i).normal(0.0, 2.0, picture.shape)
        cv2.imwrite(str(tmp_path / f"{i}.png"), np.clip(picture + grain, 0, 255).astype(np.uint8))
    looked = find_board(
        pictures([str(tmp_path), str(tmp_path / "0.png"), str(chess_folder / "01.png")]), BOARD, lambda _known: None
    )
    assert [view.name for view in looked.views] == [str(tmp_path / "0.png"), str(chess_folder / "01.png")]
    assert set(looked.unused.values()) == {"shows what 0.png shows"}
    assert looked.pictures == 4


@pytest.mark.parametrize("counted", first_of("7x6", "8x6"))
def test_squares_counted_for_corners_are_hinted_at(chess_folder, counted):
    looked = find_board(
        pictures([str(chess_folder)])[:2], parse_board(f"chessboard:{counted}:25mm"), lambda _known: None
    )
    assert not looked.views
    assert f"seen in part: 7x5 of its {counted} inner corners are in the picture" in looked.reasons
    assert looked.reasons.endswith("(2 of 2)")
