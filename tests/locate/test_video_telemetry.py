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
from scipy.spatial.transform import Rotation

from fwav_companion.cli.main import main
from fwav_companion.errors import InputFileError
from fwav_companion.photographs.flight_csv import parse_flight_csv
from fwav_companion.photographs.parrot_metadata import parrot_row
from fwav_companion.photographs.picture_pose import PicturePose
from fwav_companion.photographs.srt import parse_srt
from fwav_companion.photographs.telemetry_rows import TelemetryRow
from fwav_companion.photographs.video_poses import pose_at
from tests.support.made_videos import HEIGHT, WIDTH, parrot_v3, timed_text, write_mp4
from tests.support.maker_pictures import place_below, true_picture

CUE = "1\n00:00:01,000 --> 00:00:02,000\n"
LAYOUTS = {  # from public samples of each model
    "mavic_pro": "HOME(149.0251,-20.2532) 2017.08.05 14:11:51\nGPS(149.0200,-20.2530,16) BAROMETER:1.9\nISO:100",
    "m300": "2021.06.01 10:00:00\nGPS(-20.2530,149.0200,0.0M) BAROMETER:1.9M",
    "phantom_4": "F/6.3, SS 60, ISO 100, EV 0, GPS (149.0200, -20.2530, 15), D 24.43m, H 1.90m, H.S 0.00m/s",
    "air": "FrameCnt : 1, DiffTime : 33ms\n[fnum : 280] [latitude : -20.2530] [longtitude : 149.0200] [rel_alt: 1.9]",
    "autel": "HOME(E: 149.0251, S: 20.2532) 2020-09-08 16:49:24\nGPS(E: 149.0200, S: 20.2530, 108.3m) ReH:1.9",
    "autel_broken_sign": r"HOME(149.02, -20.25) 2019.9.8 16:49:24 \NGPS(E: 149.-0200, S: -20.2530, 108) ReH:1.9",
    "mavic_3": "[iso: 100] [latitude: -20.253000] [longitude: 149.020000] [rel_alt: 1.900 abs_alt: 108.3] [ct: 5500]",
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_srt_of_each_layout_gives_place_and_height(layout: str) -> None:
    (row,) = parse_srt("\ufeff" + CUE + LAYOUTS[layout] + "\n\n", "a.SRT")
    assert (row.at_s, row.until_s) == (1.0, 2.0)
    assert (row.lat_deg, row.lon_deg, row.above_takeoff_m) == (-20.253, 149.02, 1.9)


def test_ass_of_autel_has_the_cues_of_its_dialogue() -> None:
    text = (
        "[Events]\nFormat: Layer, Start\nDialogue: 0,0:00:01.00,0:00:02.50,Default,,0,0,0,," + LAYOUTS["autel"] + "\n"
    )
    (row,) = parse_srt(text, "a.ASS")
    assert (row.at_s, row.until_s, row.lat_deg, row.absolute_m) == (1.0, 2.5, -20.253, 108.3)


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


def test_pose_between_rows_across_the_antimeridian_is_between_them() -> None:
    rows = [
        TelemetryRow(
            at_s=at, until_s=at + 1.0, lat_deg=10.0, lon_deg=lon, above_takeoff_m=50.0, angles_deg=(0.0, -60.0, 90.0)
        )
        for at, lon in ((0.0, 179.9999), (1.0, -179.9997))
    ]
    pose = pose_at(rows, 0.75, None)
    assert isinstance(pose, PicturePose)
    assert pose.lon_deg == pytest.approx(-179.9998, abs=1e-9)
    assert pose.motion is not None
    assert pose.motion.velocity_ned == pytest.approx((0.0, 4e-4 * 111_320.0 * np.cos(np.radians(10.0)), 0.0))


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
        (lambda path: path.with_suffix(".SRT").unlink(), "no DJI_0001.SRT, .ASS or .csv"),
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


def test_srt_whose_last_subtitles_have_no_position_is_the_video_s_own(video, capsys) -> None:
    """The receiver lost its position after the first half second of three."""
    path, truth = video
    path.with_suffix(".SRT").write_text(
        f"1\n00:00:00,000 --> 00:00:00,500\n[latitude: {truth.lat:.9f}] [longitude: {truth.lon:.9f}] [rel_alt: 50.0] "
        "[focal_len: 240] [gb_yaw: 1 gb_pitch: -60.0 gb_roll: 0.0]\n\n"
        "2\n00:00:00,500 --> 00:00:03,000\n[latitude: 0.0] [longitude: 0.0] [rel_alt: 50.0]\n\n"
    )
    assert main(["locate", str(path), "--at", "0.2", "--pixel", "100,60"]) == 0
    capsys.readouterr()


def _edit(path: Path, old: str, new: str) -> None:
    srt = path.with_suffix(".SRT")
    srt.write_text(srt.read_text().replace(old, new))


def test_locate_video_with_the_detector_finds_the_tag(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from tests.vision.vision_pictures import tag_picture

    path = tmp_path / "DJI_0002.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (640, 480))
    for _ in range(20):
        writer.write(cv2.cvtColor(tag_picture((300.0, 200.0), side_px=90.0), cv2.COLOR_GRAY2BGR))
    writer.release()
    truth = true_picture(np.random.default_rng(9), pitch=-60.0, yaw=10.0, roll=0.0, width=640, height=480,
                         focal_px=640 * 24 / 36)  # fmt: skip
    path.with_suffix(".SRT").write_text(
        "".join(
            f"{at + 1}\n00:00:0{at},000 --> 00:00:0{at + 1},000\n[latitude: {truth.lat:.9f}] "
            f"[longitude: {truth.lon:.9f}] [rel_alt: {truth.above_takeoff:.3f} abs_alt: 500.0] [focal_len: 240] "
            "[gb_yaw: 10.0 gb_pitch: -60.0 gb_roll: 0.0]\n\n"
            for at in range(2)
        )
    )
    assert main(["init", str(tmp_path)]) == 0
    config = tmp_path / "fwav-companion.toml"
    config.write_text(config.read_text() + '[vision]\nsource = "pictures"\n')
    words = ["--at", "0.5", "--at", "1.2", "--detect", "--config", str(config), "--json"]
    assert main(["locate", str(path), *words]) == 0
    (target,) = json.loads(capsys.readouterr().out.splitlines()[-1])["targets"]
    lat, lon, _ = place_below(truth, 300.0, 200.0)
    error = pymap3d.geodetic2ned(target["lat"], target["lon"], 0, lat, lon, 0)
    assert np.hypot(error[0], error[1]) < 0.3
    assert len(target["pictures"]) == 2


AIRDATA = (
    "time(millisecond),datetime(utc),latitude,longitude,height_above_takeoff(feet),altitude_above_seaLevel(feet),"
    "compass_heading(degrees),gimbal_heading(degrees),gimbal_pitch(degrees),gimbal_roll(degrees),isPhoto,isVideo\n"
)


def test_airdata_rows_count_from_the_video_in_metres() -> None:
    lines = "".join(
        f"{1000 + 100 * i},2026-05-01 10:00:00,47.5,11.{i},100.0,2000.0,1,33,-50,0.5,0,{int(i >= 2)}\n"
        for i in range(5)
    )
    rows = parse_flight_csv(AIRDATA + lines, "a.csv")
    assert [row.at_s for row in rows] == pytest.approx([0.0, 0.1, 0.2])
    assert rows[0].above_takeoff_m == pytest.approx(30.48)
    assert rows[0].absolute_m == pytest.approx(609.6)
    assert (rows[0].lon_deg, rows[0].angles_deg) == (11.2, (0.5, -50.0, 33.0))


LITCHI = (
    "latitude,longitude,altitude(m),speed(mps),pitch(deg),roll(deg),yaw(deg),isTakingVideo,gimbalPitchRaw,"
    "gimbalRollRaw,gimbalYawRaw,datetime(utc),isflying\n"
)


def test_text_track_of_autel_in_the_video_is_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = true_picture(np.random.default_rng(9), lat=33.6323, lon=-117.9605, pitch=-60.0, yaw=12.0, roll=0.0,
                         width=WIDTH, height=HEIGHT, focal_px=80 / np.tan(np.radians(30)))  # fmt: skip
    said = (
        f"HOME(W: 117.9606, N: 33.6324) 2020-09-08 16:49:24\nGPS(W: {-truth.lon:.7f}, N: {truth.lat:.7f}, 55.3m) "
        f"ReH:{truth.above_takeoff:.3f}\nF.PRY (1.0°, 2.0°, 3.0°), G.PRY (-60.0°, 0.0°, 12.0°)"
    )
    path = write_mp4(tmp_path / "a.mp4", [timed_text(said)] * 3)
    _same_place(path, truth, capsys, "--hfov", "60")


def test_track_that_is_not_read_is_named_with_the_tool_that_reads_it(tmp_path: Path, capsys) -> None:
    path = write_mp4(tmp_path / "DJI_0001.mp4", [timed_text("CAM meta"), timed_text("DJI meta")])
    assert main(["locate", str(path), "--at", "1", "--pixel", "80,45"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert 'what DJI embeds (track "' in error
    assert "exiftool -ee gives as text" in error


def test_metadata_track_of_parrot_in_the_video_is_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = true_picture(np.random.default_rng(9), lat=48.8, lon=2.4, pitch=-60.0, yaw=30.0, roll=2.0,
                         width=WIDTH, height=HEIGHT, focal_px=80 / np.tan(np.radians(30)))  # fmt: skip
    x, y, z, w = Rotation.from_euler("ZYX", [30.0, -60.0, 2.0], degrees=True).as_quat()
    sample = parrot_v3(truth.lat, truth.lon, truth.alt_amsl, (w, x, y, z), 60.0)
    path = write_mp4(tmp_path / "a.mp4", [sample] * 3, as_mett=True)
    _same_place(path, truth, capsys, "--ground-alt", "400")


def _same_place(path: Path, truth: object, capsys: pytest.CaptureFixture[str], *more: str) -> None:
    lat, lon, _ = place_below(truth, 100.0, 60.0)
    assert main(["locate", str(path), "--at", "1.5", "--pixel", "100,60", *more, "--json"]) == 0
    (target,) = json.loads(capsys.readouterr().out.splitlines()[-1])["targets"]
    error = pymap3d.geodetic2ned(target["lat"], target["lon"], 0, lat, lon, 0)
    assert np.hypot(error[0], error[1]) < 0.1  # 2^-14 of the quaternion is 0.007 degrees


@pytest.mark.parametrize("seed", range(2))
def test_parrot_record_that_is_mutated_gives_a_row_or_none(seed: int) -> None:
    rng = np.random.default_rng(seed)
    good = parrot_v3(48.8, 2.4, 100.0, (1.0, 0.0, 0.0, 0.0), 60.0)
    assert parrot_row(good, 0.0) is not None
    for _ in range(200):
        data = bytearray(good)
        for at in rng.integers(0, len(data), int(rng.integers(1, 8))):
            data[at] = int(rng.integers(0, 256))
        row = parrot_row(bytes(data[: int(rng.integers(0, 80))]), 0.0)
        assert row is None or abs(row.lat_deg) <= 90.0


def test_litchi_rows_count_from_the_video_with_angles_in_tenths() -> None:
    lines = "".join(
        f"47.5,11.{i},30.5,0,1,1,99,{int(i >= 2)},-500,5,330,2026-05-01 10:00:00.{i}00,1\n" for i in range(5)
    )
    rows = parse_flight_csv(LITCHI + lines, "a.csv")
    assert [row.at_s for row in rows] == pytest.approx([0.0, 0.1, 0.2])
    assert (rows[0].above_takeoff_m, rows[0].absolute_m, rows[0].lon_deg) == (30.5, None, 11.2)
    assert rows[0].angles_deg == pytest.approx((0.5, -50.0, 33.0))


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", AIRDATA, AIRDATA + "1,x,47,11,1,1,1,1,1,1,0,0\n"])
def test_airdata_without_one_video_is_one_line(text: str) -> None:
    with pytest.raises(InputFileError, match="accepted"):
        parse_flight_csv(text, "a.csv")


def test_flight_csv_that_is_mutated_gives_rows_or_one_line() -> None:
    rng = random.Random(3)
    airdata = AIRDATA + "".join(f"{i},x,47,11.{i},1,1,1,1,1,1,0,{int(i > 0)}\n" for i in range(6))
    litchi = LITCHI + "".join(f"47,11,1,0,1,1,9,{int(i > 0)},-500,5,33,2026-05-01 10:00:0{i},1\n" for i in range(6))
    for number in range(400):
        good = (airdata, litchi)[number % 2]
        text = list(good)
        for _ in range(rng.randint(1, 20)):
            text[rng.randrange(len(text))] = rng.choice([",", '"', "\n", "\0", "nan", "", "(", "1e999"])
        with suppress(InputFileError):
            assert parse_flight_csv("".join(text), "a.csv")
