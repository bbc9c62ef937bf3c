"""`replay --poses`: photographs with poses of their own, their tables, and what is refused."""

import json
import re

import numpy as np
import pytest
from commands import run_command
from posed_pictures import COLUMNS, FIXED, TARGET, attitude, lines_of, photographs, written


@pytest.mark.parametrize("by", ["frame", "time"])
def test_exact_poses_give_exact_fixes(tmp_path, by):
    done = run_command(*written(tmp_path, photographs(12), by=by), "--sightings", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    lines = lines_of(tmp_path)
    assert lines[-1]["fixes"] == 12
    assert lines[-1]["errors"]["fixes"]["all"]["rms_m"] < 0.01
    timed = [line for line in lines if line["type"] in ("target", "sighting")]
    assert len(timed) >= 24
    assert all(line["time_boot"] is None for line in timed)
    assert {line["state"] for line in timed if line["type"] == "target"} == {"tentative", "confirmed"}


def test_the_report_is_written(tmp_path):
    done = run_command(*written(tmp_path, photographs(6)), "--report", "r", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "r/report.html").stat().st_size > 10_000


def test_a_picture_without_a_pose_is_named(tmp_path):
    words = written(tmp_path, photographs(5))
    rows = (tmp_path / "poses.csv").read_text().splitlines()
    (tmp_path / "poses.csv").write_text("\n".join(rows[:-1]) + "\n")
    done = run_command(*words, folder=tmp_path)
    assert done.returncode == 0
    assert "1 of 5 pictures" in done.stderr
    assert lines_of(tmp_path)[-1]["dropped_detections"] == {"no_pose": 1}


GOOD = "0,,48.1,11.5,579,0,-90,0"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "it has no pose"),
        (f"{COLUMNS}\n", "it has no pose"),
        (f"{COLUMNS}\n,,48.1,11.5,579,0,-90,0\n", "line 2: no file, frame or time_unix"),
        (f"{COLUMNS}\n{GOOD}\n1,,48.1,,579,0,-90,0\n", "line 3: no lon"),
        (f"{COLUMNS}\n{GOOD}\n{GOOD}\n", "line 3: a second row for picture 0"),
        (f"{COLUMNS}\n0,,148.1,11.5,579,0,-90,0\n", "line 2: lat 148.1"),
        (f"{COLUMNS}\n0,,48.1,11.5,579,0,-900,0\n", "line 2: the angles"),
        (f"{COLUMNS}\n0,,48.1,11.5,high,0,-90,0\n", "line 2: alt_amsl is 'high'"),
        (f"{COLUMNS}\n0,,48.1,11.5,nan,0,-90,0\n", "line 2: alt_amsl is 'nan'"),
        (f"{COLUMNS}\n0.5,,48.1,11.5,579,0,-90,0\n", "line 2: frame is '0.5'"),
        (f"{COLUMNS},position_sigma_m\n{GOOD},-1\n", "line 2: position_sigma_m is -1"),
        ("\x00\xff", "byte"),
    ],
)
def test_a_bad_row_is_one_line_and_exit_2(tmp_path, text, said):
    words = written(tmp_path, photographs(2))
    (tmp_path / "poses.csv").write_bytes(text.encode("latin-1"))
    done = run_command(*words, folder=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert re.search(f"poses.csv.*{re.escape(said)}.*accepted", done.stderr)


@pytest.mark.parametrize(
    ("config", "said"),
    [
        (FIXED.replace('"fixed"', '"home"'), r"\[ground\] model: home.*takeoff_alt"),
        (FIXED.replace('"fixed"', '"altitude"'), "alt_amsl"),
        (FIXED.replace('"fixed"', '"rangefinder"'), r"\[ground\] model: rangefinder"),
    ],
)
def test_a_ground_that_needs_an_autopilot_is_exit_2(tmp_path, config, said):
    done = run_command(*written(tmp_path, photographs(2), config=config), folder=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert re.search(said, done.stderr)


def test_poses_and_telemetry_together_are_exit_2(tmp_path):
    done = run_command(*written(tmp_path, photographs(2)), "--telemetry", "a.tlog", folder=tmp_path)
    assert done.returncode == 2
    assert "--poses" in done.stderr


def test_poses_by_file_are_joined_by_the_names_of_the_detections(tmp_path):
    words = written(tmp_path, photographs(5))
    text = (tmp_path / "poses.csv").read_text().splitlines()
    rows = [f"{number}.jpg,{row.partition(',')[2].lstrip(',')}" for number, row in enumerate(text[1:])]
    head = "file," + text[0].removeprefix("frame,time_unix,")
    (tmp_path / "poses.csv").write_text("\n".join([head, *reversed(rows)]) + "\n")
    frames = [json.loads(line) for line in (tmp_path / "d.jsonl").read_text().splitlines()]
    lines = [json.dumps({**frame, "file": f"{number}.jpg"}) for number, frame in enumerate(frames)]
    (tmp_path / "d.jsonl").write_text("\n".join(lines) + "\n")
    done = run_command(*words, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert lines_of(tmp_path)[-1]["errors"]["fixes"]["all"]["rms_m"] < 0.01


def test_ground_control_is_the_truth(tmp_path):
    """In UTM as GDAL computes it; of two sights of one point, one point."""
    warp = pytest.importorskip("rasterio.warp")
    words = written(tmp_path, photographs(5))
    (east,), (north,) = warp.transform("EPSG:4326", "EPSG:32632", [TARGET[1]], [TARGET[0]])
    point = f"{east:.4f} {north:.4f} {TARGET[2]}"
    (tmp_path / "gcp_list.txt").write_text(
        f"EPSG:32632\n# surveyed\n{point} 10.5 20.5 0.jpg rock\n{point} 11.5 20.5 1.jpg rock\n"
    )
    words[words.index("truth.csv")] = "gcp_list.txt"
    done = run_command(*words, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    errors = lines_of(tmp_path)[-1]["errors"]["fixes"]["all"]
    assert errors["rms_m"] < 0.02
    (tmp_path / "gcp_list.txt").write_text("EPSG:32632\n1 2 x 10.5 20.5 0.jpg rock\n")
    done = run_command(*words, folder=tmp_path)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "gcp_list.txt: line 2: 1 2 x is no place" in done.stderr


def test_a_pix4d_table_is_read_as_poses(tmp_path):
    """Omega, phi, kappa by the definition, at the central meridian of UTM 32, where grid north is true north."""
    from fwav_companion.geometry.map_grid import utm_from_degrees

    names, rows = [], []
    pictures = list(photographs(6))
    shift = 9.0 - TARGET[1]  # to the central meridian
    for number, (_, ((lat, lon, alt), angles)) in enumerate(pictures):
        utm = utm_from_degrees(lat, lon + shift)
        ned_from_camera = attitude(*angles) @ np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
        world = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]) @ ned_from_camera @ np.diag([1, -1, -1])
        omega, phi, kappa = (
            np.arctan2(-world[1, 2], world[2, 2]),
            np.arcsin(world[0, 2]),
            np.arctan2(-world[0, 1], world[0, 0]),
        )
        turn = np.degrees([omega, phi, kappa])
        names.append(f"{number}.jpg")
        rows.append(
            f"{names[-1]} {utm.easting_m:.4f} {utm.northing_m:.4f} {alt:.4f} {turn[0]:.8f} {turn[1]:.8f} {turn[2]:.8f}"
        )
    config = FIXED
    words = written(tmp_path, pictures, config=config)
    (tmp_path / "poses.csv").write_text("# EPSG:32632\nimageName X Y Z Omega Phi Kappa\n" + "\n".join(rows) + "\n")
    frames = [json.loads(line) for line in (tmp_path / "d.jsonl").read_text().splitlines()]
    lines = [json.dumps({**frame, "file": name}) for frame, name in zip(frames, names, strict=True)]
    (tmp_path / "d.jsonl").write_text("\n".join(lines) + "\n")
    (tmp_path / "truth.csv").write_text(f"label,lat,lon,alt_amsl\nrock,{TARGET[0]},{TARGET[1] + shift},{TARGET[2]}\n")
    done = run_command(*words, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert lines_of(tmp_path)[-1]["errors"]["fixes"]["all"]["rms_m"] < 0.05
