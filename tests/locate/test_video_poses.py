"""`detect VIDEO` writes poses by the telemetry; `replay --poses` joins them, and finds the telemetry's delay."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from fwav_companion.cli.main import main
from sitl_mock.maker_tags import TruePicture
from tests.locate.test_klv import packet, write_stream
from tests.support.made_videos import HEIGHT, WIDTH, timed_text, write_mp4
from tests.support.maker_pictures import pixel_of, true_picture

pytest.importorskip("av")
FOCAL = 80 / np.tan(np.radians(30))
CAMERA = f"""
image_width: {WIDTH}
image_height: {HEIGHT}
distortion_model: plumb_bob
camera_matrix: {{rows: 3, cols: 3, data: [{FOCAL}, 0, {(WIDTH - 1) / 2}, 0, {FOCAL}, {(HEIGHT - 1) / 2}, 0, 0, 1]}}
distortion_coefficients: {{rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}}
"""
CONFIG = """
[camera]
calibration = "camera.yaml"
readout_s = 0.0
[ground]
model = "altitude"
alt_amsl = 400.0
[tracking]
self_calibration = true
"""


def on_eight(at_s: float) -> TruePicture:
    """A drone on an eight of 50 m, 60 m above the ground, that looks at its middle; a circle would hide a delay."""
    turn = 0.25 * at_s
    north, east = 25.0 * np.sin(turn), 12.0 * np.sin(2.0 * turn)
    yaw = 40.0 * np.sin(0.9 * turn)
    return true_picture(
        np.random.default_rng(1), lat=47.0 + np.degrees(north / 6.367e6),
        lon=11.0 + np.degrees(east / (6.3887e6 * np.cos(np.radians(47.0)))), above_takeoff=60.0, alt_amsl=460.0,
        yaw=float(yaw), pitch=-80.0, roll=0.0, width=WIDTH, height=HEIGHT, focal_px=float(FOCAL),
    )  # fmt: skip


def subtitle(p: TruePicture, at_s: float) -> str:
    stamp = f"00:00:{at_s:06.3f}".replace(".", ",")
    until = f"00:00:{at_s + 1:06.3f}".replace(".", ",")
    yaw = (p.yaw + 180.0) % 360.0 - 180.0
    return (
        f"1\n{stamp} --> {until}\n[latitude: {p.lat:.9f}] [longitude: {p.lon:.9f}] [rel_alt: 60.0 abs_alt: 500.0] "
        f"[focal_len: 240] [gb_yaw: {yaw:.4f} gb_pitch: -80.0 gb_roll: 0.0]\n\n"
    )


def flight(folder: Path, seconds: int, delay_s: float) -> Path:
    """A video whose .SRT comes once a second, and is late: what it says at t was so at t - delay."""
    path = write_mp4(folder / "a.mp4", [timed_text("nothing")], seconds=seconds)
    path.with_suffix(".SRT").write_text("".join(subtitle(on_eight(t - delay_s), float(t)) for t in range(seconds)))
    return path


def test_detect_video_writes_a_pose_for_each_frame(tmp_path: Path) -> None:
    path, out = flight(tmp_path, 3, 0.0), tmp_path / "poses.csv"
    assert main(["detect", str(path), "--poses-out", str(out), "--start", "2026-05-01T12:00:00Z"]) == 0
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert [int(row["frame"]) for row in rows] == list(range(30))
    middle = on_eight(0.5)
    assert float(rows[5]["lat"]) == pytest.approx(middle.lat, abs=2.2e-6)  # 0.23 m: straight between two rows
    assert float(rows[5]["yaw_deg"]) % 360.0 == pytest.approx(middle.yaw, abs=0.05)
    assert {(row["alt_datum"], row["alt"], row["time_offset_sigma_s"]) for row in rows} == {("takeoff", "60.0", "0.5")}
    assert float(rows[5]["time_unix"]) - float(rows[0]["time_unix"]) == pytest.approx(0.5)


def test_detect_video_takes_utc_and_poses_from_its_metadata(tmp_path: Path) -> None:
    path, out = tmp_path / "a.ts", tmp_path / "poses.csv"
    write_stream(path, [packet(_104=None, _2=1_700_000_037_000_000 + 100_000 * i, _136=37) for i in range(30)])
    assert main(["detect", str(path), "--poses-out", str(out)]) == 0
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert (len(rows), rows[0]["alt_datum"]) == (75, "egm96")
    assert float(rows[0]["time_unix"]) == pytest.approx(1_700_000_000.0, abs=0.05)
    assert main(["detect", str(path), "--poses-out", str(out), "--klv-time", "utc"]) == 0
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert float(rows[0]["time_unix"]) == pytest.approx(1_700_000_037.0, abs=0.05)


def test_detect_video_without_angles_asks_for_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = flight(tmp_path, 3, 0.0), tmp_path / "poses.csv"
    path.with_suffix(".SRT").write_text(path.with_suffix(".SRT").read_text().replace("gb_", "xx_"))
    assert main(["detect", str(path), "--poses-out", str(out)]) == 2
    assert "give --angles" in capsys.readouterr().err
    assert main(["detect", str(path), "--poses-out", str(out), "--angles", "0,-60,10"]) == 0
    assert {row["yaw_deg"] for row in csv.DictReader(out.read_text().splitlines())} == {"10.0"}


@pytest.mark.slow
@pytest.mark.parametrize("delay_s", [-0.6, 0.4])
def test_replay_finds_the_delay_of_the_telemetry(tmp_path: Path, delay_s: float) -> None:
    seconds = 40
    path, out = flight(tmp_path, seconds, delay_s), tmp_path / "poses.csv"
    start = 1_790_000_000.0
    given = ["--start", "2026-09-21T14:13:20Z", "--takeoff-alt", "400"]
    assert main(["detect", str(path), "--poses-out", str(out), *given]) == 0
    rng, lines = np.random.default_rng(5), []
    spots = {"a": (0.0, 0.0), "b": (8.0, -5.0), "c": (-6.0, 9.0)}
    for number in range(10 * seconds):
        picture, found = on_eight(number / 10.0), []
        for label, (north, east) in spots.items():
            lat = 47.0 + np.degrees(north / 6.367e6)
            lon = 11.0 + np.degrees(east / (6.3887e6 * np.cos(np.radians(47.0))))
            u, v = np.array(pixel_of(picture, lat, lon, 400.0)) + rng.normal(0, 0.3, 2)
            if 0 <= u < WIDTH and 0 <= v < HEIGHT:
                found.append({"u": u, "v": v, "sigma": 0.3, "label": label})
        lines.append(json.dumps({"time_unix": start + number / 10.0, "frame": number, "detections": found}))
    (tmp_path / "d.jsonl").write_text("\n".join(lines) + "\n")
    (tmp_path / "c.toml").write_text(CONFIG)
    (tmp_path / "camera.yaml").write_text(CAMERA)
    words = ["--poses", str(out), "--detections", str(tmp_path / "d.jsonl"), "--config", str(tmp_path / "c.toml")]
    assert main(["replay", *words, "--out", str(tmp_path / "t.jsonl")]) == 0
    written = [json.loads(line) for line in (tmp_path / "t.jsonl").read_text().splitlines()]
    last = [line for line in written if line["type"] == "calibration"][-1]
    assert last["time_offset_s"] == pytest.approx(-delay_s, abs=3.0 * last["time_offset_sigma_s"] + 0.02)
    assert last["time_offset_sigma_s"] < 0.2
