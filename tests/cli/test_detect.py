"""``detect``: the configured detector over pictures with known content, times and poses."""

import csv
import json
import sys
from datetime import UTC, datetime
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from fwav_companion.cli.main import main
from fwav_companion.recording.folder import RecordingPlan
from fwav_companion.recording.photograph_poses import parse_poses
from fwav_companion.recording.recorder import Recorder

sys.path.insert(0, str(Path(__file__).parents[1] / "vision"))
from vision_pictures import tag_picture

EXIF_IFD, GPS_IFD = 0x8769, 0x8825
NOON_S = datetime(2026, 5, 1, 12, 0, 0, tzinfo=UTC).timestamp()
DJI = (
    '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:Description drone-dji:GpsLatitude="+48.1371999" '
    'drone-dji:GpsLongtitude="+11.5756003" drone-dji:AbsoluteAltitude="+560.40" drone-dji:GimbalRollDegree="+0.10" '
    'drone-dji:GimbalYawDegree="-33.50" drone-dji:GimbalPitchDegree="-89.90" drone-dji:RtkStdLon="0.011" '
    'drone-dji:RtkStdLat="0.012" drone-dji:RtkStdHgt="0.031" drone-dji:RtkFlag="50"/></x:xmpmeta>'
)


@pytest.fixture
def config(tmp_path):
    assert main(["init", str(tmp_path)]) == 0
    path = tmp_path / "fwav-companion.toml"
    path.write_text(path.read_text() + '[vision]\nsource = "pictures"\n')
    return path


def photograph(path, *, time=None, offset=None, gps=None, exposure=None, xmp=None, make=None):
    image = Image.fromarray(tag_picture((320.0, 240.0), side_px=90.0))
    exif = image.getexif()
    if make is not None:
        exif[0x010F] = make
    own = exif.get_ifd(EXIF_IFD)
    own |= {tag: value for tag, value in ((0x9003, time), (0x9011, offset), (0x829A, exposure)) if value is not None}
    if gps is not None:
        exif.get_ifd(GPS_IFD).update(gps)
    extra = {"xmp": xmp.encode()} if xmp else {}
    image.save(path, exif=exif, quality=95, **extra)


def detected(config, pictures, *words):
    out = config.parent / "d.jsonl"
    status = main(["detect", str(pictures), "--config", str(config), "--out", str(out), *words])
    return status, [json.loads(line) for line in out.read_text().splitlines()] if out.exists() else None


def test_a_folder_with_stamps_keeps_them(tmp_path, config, capsys):
    folder = tmp_path / "pictures"
    folder.mkdir()
    lines = []
    for i in range(3):
        cv2.imwrite(str(folder / f"{i}.png"), tag_picture((200.0 + 10 * i, 120.0), side_px=60.0))
        lines.append(json.dumps({"file": f"{i}.png", "time_monotonic": 10.0 + i, "frame": 7 + i, "exposure_s": 0.002}))
    (folder / "stamps.jsonl").write_text("\n".join(lines) + "\n")
    status, frames = detected(config, folder, "--json")
    assert status == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1]) == {"frames": 3, "detections": 3}
    for i, frame in enumerate(frames):
        assert (frame["time_monotonic"], frame["frame"], frame["exposure_s"]) == (10.0 + i, 7 + i, 0.002)
        assert frame["size"] == [640, 480]
        assert frame["detections"][0]["label"] == "tag36h11:7"
        assert frame["detections"][0]["u"] == pytest.approx(200.0 + 10 * i, abs=0.3)


def test_a_recording_with_pictures_is_read_but_for_the_line_that_a_power_cut_left(tmp_path, config, capsys):
    recorder = Recorder(RecordingPlan(directory=tmp_path / "records", sync_s=0.05), [].append)
    recorder.start()
    recorder.detection(1, b"{}\n")
    for i in range(2):
        jpeg = cv2.imencode(".jpg", tag_picture((200.0 + 10 * i, 120.0)))[1].tobytes()
        recorder.picture(f"{i}.jpg", jpeg, b'{"file":"%d.jpg","time_unix":%d.25,"frame":%d}\n' % (i, 100 + i, 7 + i))
    recorder.close(5.0)
    (recording,) = (tmp_path / "records").iterdir()
    with (recording / "pictures" / "stamps.jsonl").open("a") as stamps:
        stamps.write('{"file":"2.jpg","time_un')
    status, frames = detected(config, recording)
    assert status == 0
    assert [(frame["time_unix"], frame["frame"]) for frame in frames] == [(100.25, 7), (101.25, 8)]
    assert [frame["detections"][0]["u"] for frame in frames] == pytest.approx([200.0, 210.0], abs=0.3)


def test_photographs_by_the_zone_of_their_clock_and_by_gps(tmp_path, config):
    folder = tmp_path / "pictures"
    folder.mkdir()
    photograph(folder / "b.jpg", time="2026:05:01 14:00:02", offset="+02:00", exposure=0.001)
    gps = {29: "2026:05:01", 7: (12.0, 0.0, 1.0)}
    photograph(folder / "c.jpg", time="2026:05:01 09:00:01", gps=gps)
    photograph(folder / "a.jpg", time="2026:05:01 08:30:00", offset="-03:30")
    status, frames = detected(config, folder)
    assert status == 0
    assert [frame["time_unix"] for frame in frames] == [NOON_S, NOON_S + 1.0, NOON_S + 2.0]
    assert [frame["frame"] for frame in frames] == [0, 1, 2]
    assert frames[2]["exposure_s"] == pytest.approx(0.001)
    assert all(len(frame["detections"]) == 1 for frame in frames)


def test_photographs_without_a_zone_ask_for_a_start_and_count_from_it(tmp_path, config, capsys):
    folder = tmp_path / "pictures"
    folder.mkdir()
    photograph(folder / "a.jpg", time="2026:05:01 09:00:01")
    photograph(folder / "b.jpg", time="2026:05:01 09:00:03")
    status, frames = detected(config, folder)
    assert (status, frames) == (2, None)
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "neither a time with a zone nor GPS time; give the first picture's time with its zone, as --start" in error
    _, frames = detected(config, folder, "--start", "2026-05-01T14:00:00+02:00")
    assert [frame["time_unix"] for frame in frames] == [NOON_S, NOON_S + 2.0]


@pytest.mark.parametrize("start", ["2026-05-01T14:00:00", "yesterday", ""])
def test_a_start_without_a_zone_is_refused(tmp_path, config, capsys, start):
    status, _ = detected(config, tmp_path, "--start", start)
    assert status == 2
    assert "accepted: ISO 8601 with a zone" in capsys.readouterr().err


def test_a_video_counts_from_its_start(tmp_path, config, capsys):
    path = tmp_path / "flight.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 20.0, (640, 480))
    for i in range(4):
        writer.write(cv2.cvtColor(tag_picture((300.0 + 5 * i, 200.0), side_px=90.0), cv2.COLOR_GRAY2BGR))
    writer.release()
    assert detected(config, path)[0] == 2
    assert "--start" in capsys.readouterr().err
    _, frames = detected(config, path, "--start", "2026-05-01T12:00:00Z")
    times = np.array([frame["time_unix"] for frame in frames])
    assert times - times[0] == pytest.approx([0.0, 0.05, 0.1, 0.15], abs=1e-3)
    assert times[0] == pytest.approx(NOON_S, abs=0.051)
    assert [round(frame["detections"][0]["u"]) for frame in frames] == [300, 305, 310, 315]


def test_the_poses_of_a_makers_metadata_are_what_replay_reads(tmp_path, config):
    folder, out = tmp_path / "pictures", tmp_path / "poses.csv"
    folder.mkdir()
    photograph(folder / "a.jpg", time="2026:05:01 14:00:00", offset="+02:00", xmp=DJI)
    parrot = (
        '<x:xmpmeta xmlns:x="adobe:ns:meta/"><drone-parrot:CameraRollDegree>1.5</drone-parrot:CameraRollDegree>'
        "<drone-parrot:CameraPitchDegree>-45</drone-parrot:CameraPitchDegree>"
        "<drone-parrot:CameraYawDegree>90</drone-parrot:CameraYawDegree></x:xmpmeta>"
    )
    gps = {1: "S", 2: (33.0, 30.0, 0.0), 3: "W", 4: (70.0, 36.0, 0.0), 5: b"\x00", 6: 620.5}
    photograph(folder / "b.jpg", time="2026:05:01 14:00:01", offset="+02:00", xmp=parrot, gps=gps)
    photograph(folder / "c.jpg", time="2026:05:01 14:00:02", offset="+02:00")
    assert detected(config, folder, "--poses-out", str(out))[0] == 0
    poses = parse_poses(out.read_text(), "poses.csv", lambda lat, lon: 46.0).poses
    assert [pose.frame for pose in poses] == [0, 1]
    assert poses[0].place.alt_amsl_m == pytest.approx(560.4 - 46.0)  # RTK: above the ellipsoid
    first, second = csv.DictReader(out.read_text().splitlines())
    assert first == {
        "file": "a.jpg", "frame": "0", "time_unix": str(NOON_S), "lat": "48.1371999", "lon": "11.5756003",
        "alt": "560.4", "alt_datum": "ellipsoid", "roll_deg": "0.1", "pitch_deg": "-89.9", "yaw_deg": "-33.5",
        "position_sigma_m": "0.012", "height_sigma_m": "0.031", "attitude_sigma_deg": "0.3",
        "position_bias_m": "0.03", "height_bias_m": "0.03", "heading_bias_deg": "1.0", "mount_bias_deg": "0.5",
        "width": "640", "height": "480",
    }  # fmt: skip
    assert [float(second[key]) for key in ("lat", "lon", "alt")] == pytest.approx([-33.5, -70.6, 620.5])
    assert (second["alt_datum"], second["position_sigma_m"]) == ("egm96", "1.0")


def test_poses_alone_need_no_configuration_and_no_times(tmp_path, capsys):
    folder, out = tmp_path / "pictures", tmp_path / "poses.csv"
    folder.mkdir()
    photograph(folder / "a.jpg", xmp=DJI)
    photograph(folder / "b.jpg")
    photograph(folder / "c.jpg", xmp=DJI)
    assert main(["detect", str(folder), "--poses-out", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"pictures": 3, "poses": 2}
    assert [(row["file"], row["frame"]) for row in csv.DictReader(out.read_text().splitlines())] == [
        ("a.jpg", "0"),
        ("c.jpg", "2"),
    ]
    (tmp_path / "c.toml").write_text('[detections]\nurl = ""\n')
    assert main(["detect", str(folder), "--config", str(tmp_path / "c.toml"), "--poses-out", str(out)]) == 0
    assert main(["detect", str(folder)]) == 2
    assert "--poses-out CSV alone" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("stated", "counted"),
    [
        ([], ("620.5", "ellipsoid", "20.0")),
        (["--alt-datum", "egm96"], ("620.5", "egm96", "5.0")),
        (["--alt-datum", "takeoff"], ("620.5", "takeoff", "3.0")),
    ],
)
def test_an_altitude_counts_from_the_stated_datum(tmp_path, stated, counted):
    """An Autel without a height above the take-off: its datum is not known, unless somebody says it."""
    folder, out = tmp_path / "pictures", tmp_path / "poses.csv"
    folder.mkdir()
    xmp = (
        '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:Description drone-dji:GimbalRollDegree="0" '
        'drone-dji:GimbalPitchDegree="-45" drone-dji:GimbalYawDegree="9"/></x:xmpmeta>'
    )
    gps = {1: "N", 2: (33.0, 30.0, 0.0), 3: "E", 4: (70.0, 36.0, 0.0), 5: b"\x00", 6: 620.5}
    photograph(folder / "a.jpg", xmp=xmp, gps=gps, make="Autel Robotics")
    assert main(["detect", str(folder), "--poses-out", str(out), *stated]) == 0
    (row,) = csv.DictReader(out.read_text().splitlines())
    assert (row["alt"], row["alt_datum"], row["height_bias_m"]) == counted


def test_pictures_with_stamps_give_the_poses_of_their_tags(tmp_path, config):
    folder, out = tmp_path / "pictures", tmp_path / "poses.csv"
    folder.mkdir()
    photograph(folder / "a.jpg", xmp=DJI)
    (folder / "stamps.jsonl").write_text(json.dumps({"file": "a.jpg", "time_unix": NOON_S, "frame": 7}) + "\n")
    status, frames = detected(config, folder, "--poses-out", str(out))
    assert status == 0
    assert frames[0]["file"] == "a.jpg"
    (row,) = csv.DictReader(out.read_text().splitlines())
    assert (row["frame"], row["alt_datum"], float(row["lat"])) == ("7", "ellipsoid", 48.1371999)


@pytest.mark.parametrize(
    ("what", "reported"),
    [
        ("nowhere", "no such file"),
        ("empty", "no pictures in it"),
        ("text.jpg", "not a picture"),
        ("text.mp4", "not a video or picture"),
    ],
)
def test_what_is_no_picture_is_one_line(tmp_path, config, capsys, what, reported):
    (tmp_path / "empty").mkdir()
    for name in ("text.jpg", "text.mp4"):
        (tmp_path / name).write_text("text")
    status, frames = detected(config, tmp_path / what, "--start", "2026-05-01T12:00:00Z")
    error = capsys.readouterr().err
    assert (status, frames, error.count("\n")) == (2, None, 1)
    assert reported in error


def test_without_vision_there_is_no_detector(tmp_path, config, capsys):
    config.write_text(config.read_text().replace('[vision]\nsource = "pictures"\n', ""))
    assert detected(config, tmp_path)[0] == 2
    assert '[vision]: missing; accepted: a table with detector = "apriltag"' in capsys.readouterr().err
