"""Subtitles of DJI's videos in each known layout, and places of pixels in a video."""

from __future__ import annotations

import json
import random
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pymap3d
import pytest

from fwav_companion.cli.main import main
from fwav_companion.errors import InputFileError
from fwav_companion.photographs.airdata import parse_airdata
from fwav_companion.photographs.srt import parse_srt
from tests.support.maker_pictures import place_below, true_picture

CUE = "1\n00:00:01,000 --> 00:00:02,000\n"
LAYOUTS = {  # from public samples of each model
    "mavic_pro": "HOME(149.0251,-20.2532) 2017.08.05 14:11:51\nGPS(149.0200,-20.2530,16) BAROMETER:1.9\nISO:100",
    "m300": "2021.06.01 10:00:00\nGPS(-20.2530,149.0200,0.0M) BAROMETER:1.9M",
    "phantom_4": "F/6.3, SS 60, ISO 100, EV 0, GPS (149.0200, -20.2530, 15), D 24.43m, H 1.90m, H.S 0.00m/s",
    "air": "FrameCnt : 1, DiffTime : 33ms\n[fnum : 280] [latitude : -20.2530] [longtitude : 149.0200] [rel_alt: 1.9]",
    "mavic_3": "[iso: 100] [latitude: -20.253000] [longitude: 149.020000] [rel_alt: 1.900 abs_alt: 108.3] [ct: 5500]",
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_srt_of_each_layout_gives_place_and_height(layout: str) -> None:
    (row,) = parse_srt("\ufeff" + CUE + LAYOUTS[layout] + "\n\n", "a.SRT")
    assert (row.at_s, row.until_s) == (1.0, 2.0)
    assert (row.lat_deg, row.lon_deg, row.above_takeoff_m) == (-20.253, 149.02, 1.9)


def test_srt_gimbal_angles_are_named_or_in_the_order_pitch_roll_yaw() -> None:
    text = LAYOUTS["phantom_4"] + ", F.PRY (1.1°, 2.2°, 3.3°), G.PRY (-50.0°, 0.5°, 33.0°)"
    (row,) = parse_srt(CUE + text, "a.SRT")
    assert row.angles_deg == (0.5, -50.0, 33.0)
    (row,) = parse_srt(CUE + LAYOUTS["mavic_3"] + "[gb_yaw: 33.0 gb_pitch: -50.0 gb_roll: 0.5]", "a.SRT")
    assert row.angles_deg == (0.5, -50.0, 33.0)


def test_srt_focal_length_in_tenths_counts_with_the_zoom() -> None:
    (row,) = parse_srt(CUE + LAYOUTS["mavic_3"] + "[focal_len: 240] [dzoom_ratio: 20000]", "a.SRT")
    assert row.focal_35mm == 48.0


def test_srt_that_is_mutated_gives_rows_or_one_line() -> None:
    rng = random.Random(2)
    good = "".join(CUE + text + "\n\n" for text in LAYOUTS.values())
    for _ in range(200):
        text = list(good)
        for _ in range(rng.randint(1, 30)):
            text[rng.randrange(len(text))] = rng.choice([":", "(", "]", "9" * 5, "", "\0", "-", "nan", "\n"])
        with suppress(InputFileError):
            rows = parse_srt("".join(text)[: rng.randrange(1, len(text))], "a.SRT")
            assert all(abs(row.lat_deg) <= 90.0 for row in rows)


@pytest.fixture
def video(tmp_path: Path) -> tuple[Path, object]:
    """Three seconds of video; the gimbal's pose at 1.5 s lies between two subtitles."""
    path = tmp_path / "DJI_0001.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (160, 90))
    for _ in range(30):
        writer.write(np.zeros((90, 160, 3), np.uint8))
    writer.release()
    truth = true_picture(np.random.default_rng(9), pitch=-60.0, yaw=359.0, roll=0.0, width=160, height=90,
                         focal_px=160 * 24 / 36)  # fmt: skip
    lines = []
    for index, (at, yaw) in enumerate([(0, 355.0), (1, 357.0), (2, 1.0)]):
        lines.append(
            f"{index + 1}\n00:00:0{at},000 --> 00:00:0{at + 1},000\n[latitude: {truth.lat:.9f}] "
            f"[longitude: {truth.lon:.9f}] [rel_alt: {truth.above_takeoff:.3f} abs_alt: 500.0] [focal_len: 240] "
            f"[gb_yaw: {yaw} gb_pitch: -60.0 gb_roll: 0.0]\n\n"
        )
    path.with_suffix(".SRT").write_text("".join(lines))
    return path, truth


def test_locate_video_between_subtitles_gives_the_place(video, capsys: pytest.CaptureFixture[str]) -> None:
    path, truth = video
    lat, lon, _ = place_below(truth, 100.0, 60.0)
    assert main(["locate", str(path), "--at", "00:00:01.5", "--pixel", "100,60", "--json"]) == 0
    (target,) = json.loads(capsys.readouterr().out.splitlines()[-1])["targets"]
    error = pymap3d.geodetic2ned(target["lat"], target["lon"], 0, lat, lon, 0)
    assert np.hypot(error[0], error[1]) < 0.05
    assert target["alt_amsl"] is None


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda path: path.with_suffix(".SRT").unlink(), "no DJI_0001.SRT or .csv"),
        (lambda path: path.write_bytes(b"no video"), "not a video"),
        (lambda path: _edit(path, "00:00:03,000", "00:00:09,000"), "another video's"),
        (lambda path: _edit(path, "gb_", "xx_"), "--angles"),
        (lambda path: _edit(path, "focal_len", "x"), "--hfov"),
    ],
)
def test_locate_video_with_something_missing_is_one_line(video, change, said: str, capsys) -> None:
    path, _ = video
    change(path)
    assert main(["locate", str(path), "--at", "1.5", "--pixel", "100,60"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert said in error


def _edit(path: Path, old: str, new: str) -> None:
    srt = path.with_suffix(".SRT")
    srt.write_text(srt.read_text().replace(old, new))


AIRDATA = (
    "time(millisecond),datetime(utc),latitude,longitude,height_above_takeoff(feet),altitude_above_seaLevel(feet),"
    "compass_heading(degrees),gimbal_heading(degrees),gimbal_pitch(degrees),gimbal_roll(degrees),isPhoto,isVideo\n"
)


def test_airdata_rows_count_from_the_video_in_metres() -> None:
    lines = "".join(
        f"{1000 + 100 * i},2026-05-01 10:00:00,47.5,11.{i},100.0,2000.0,1,33,-50,0.5,0,{int(i >= 2)}\n"
        for i in range(5)
    )
    rows = parse_airdata(AIRDATA + lines, "a.csv")
    assert [row.at_s for row in rows] == pytest.approx([0.0, 0.1, 0.2])
    assert rows[0].above_takeoff_m == pytest.approx(30.48)
    assert rows[0].absolute_m == pytest.approx(609.6)
    assert (rows[0].lon_deg, rows[0].angles_deg) == (11.2, (0.5, -50.0, 33.0))


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", AIRDATA, AIRDATA + "1,x,47,11,1,1,1,1,1,1,0,0\n"])
def test_airdata_without_one_video_is_one_line(text: str) -> None:
    with pytest.raises(InputFileError, match="accepted"):
        parse_airdata(text, "a.csv")


def test_airdata_that_is_mutated_gives_rows_or_one_line() -> None:
    rng = random.Random(3)
    good = AIRDATA + "".join(f"{i},x,47,11.{i},1,1,1,1,1,1,0,{int(i > 0)}\n" for i in range(6))
    for _ in range(200):
        text = list(good)
        for _ in range(rng.randint(1, 20)):
            text[rng.randrange(len(text))] = rng.choice([",", '"', "\n", "\0", "nan", "", "(", "1e999"])
        with suppress(InputFileError):
            assert parse_airdata("".join(text), "a.csv")
