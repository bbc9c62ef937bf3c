"""`replay --poses`: photographs with poses of their own. The oracle is a pinhole camera and ECEF, in numpy."""

import json
import re

import numpy as np
import pytest
from commands import run_command

LENS = """
image_width: 4000
image_height: 3000
distortion_model: plumb_bob
camera_matrix: {rows: 3, cols: 3, data: [3000.0, 0, 2000.0, 0, 3000.0, 1500.0, 0, 0, 1]}
distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
"""
FIXED = '[camera]\ncalibration = "camera.yaml"\nreadout_s = 0.0\n[ground]\nmodel = "fixed"\nheight_m = 60.0\n'
TARGET = (48.137, 11.575, 519.0)
BEGUN_S = 1_790_000_000.0
COLUMNS = "frame,time_unix,lat,lon,alt_amsl,roll_deg,pitch_deg,yaw_deg"


def ecef(lat_deg, lon_deg, height_m):
    lat, lon = np.radians([lat_deg, lon_deg])
    e2 = (2.0 - 1.0 / 298.257223563) / 298.257223563
    n = 6378137.0 / np.sqrt(1.0 - e2 * np.sin(lat) ** 2)
    flat = (n + height_m) * np.cos(lat)
    return np.array([flat * np.cos(lon), flat * np.sin(lon), (n * (1.0 - e2) + height_m) * np.sin(lat)])


def ned_axes(lat_deg, lon_deg):
    lat, lon = np.radians([lat_deg, lon_deg])
    north = [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)]
    east = [-np.sin(lon), np.cos(lon), 0.0]
    return np.array([north, east, np.cross(north, east)])


def attitude(roll, pitch, yaw):
    """Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    return rz @ ry @ rx


def pixel(place, angles):
    """The target's pixel: forward, right and down of the camera are the axes of its attitude."""
    ned = ned_axes(*TARGET[:2]) @ (ecef(*TARGET) - ecef(*place))
    forward, right, down = attitude(*angles).T @ ned
    return 2000.0 + 3000.0 * right / forward, 1500.0 + 3000.0 * down / forward


def moved(place, ned):
    lat, lon, alt = place
    return (
        lat + np.degrees(ned[0] / 6.367e6),
        lon + np.degrees(ned[1] / (6.3887e6 * np.cos(np.radians(lat)))),
        alt - ned[2],
    )


def photographs(count, *, seed=1, sigmas=(0.0, 0.0, 0.0), height_m=60.0):
    """(true and claimed pose) of each picture around the target, which is in all of them."""
    draw = np.random.default_rng(seed)
    position_m, height_sigma_m, angle = sigmas
    for _ in range(count):
        tilt, yaw = draw.uniform(0.0, 0.5), draw.uniform(-np.pi, np.pi)
        away = height_m * np.tan(tilt)
        place = moved(TARGET, (-away * np.cos(yaw), -away * np.sin(yaw), -height_m))
        angles = np.array([draw.uniform(-0.1, 0.1), tilt - np.pi / 2, yaw])
        error = draw.normal(size=3) * (position_m, position_m, height_sigma_m)
        turn = attitude(*(draw.normal(size=3) * angle))
        claimed = attitude(*angles) @ turn
        euler = (
            np.arctan2(claimed[2, 1], claimed[2, 2]),
            -np.arcsin(claimed[2, 0]),
            np.arctan2(claimed[1, 0], claimed[0, 0]),
        )
        yield (place, angles), (moved(place, error), euler)


def written(folder, pictures, *, config=FIXED, by="frame", sigmas=""):
    """Writes the files of a flight; returns the words that replay it."""
    rows = [COLUMNS + (",position_sigma_m,height_sigma_m,attitude_sigma_deg" if sigmas else "")]
    frames = []
    for number, (truth, (place, angles)) in enumerate(pictures):
        at = BEGUN_S + 8.0 * number
        key = {"frame": f"{number},", "time": f",{at + 0.004:.3f}"}[by]
        rows.append(f"{key},{place[0]:.9f},{place[1]:.9f},{place[2]:.3f},{_degrees(angles)}{sigmas}")
        u, v = pixel(*truth)
        frames.append(
            {"time_unix": at, "frame": number, "detections": [{"u": u, "v": v, "sigma": 1.0, "label": "rock"}]}
        )
    (folder / "poses.csv").write_text("\n".join(rows) + "\n")
    (folder / "d.jsonl").write_text("".join(json.dumps(frame) + "\n" for frame in frames))
    (folder / "flight.toml").write_text(config)
    (folder / "camera.yaml").write_text(LENS)
    (folder / "truth.csv").write_text(f"label,lat,lon,alt_amsl\nrock,{TARGET[0]},{TARGET[1]},{TARGET[2]}\n")
    words = ["--poses", "poses.csv", "--detections", "d.jsonl", "--config", "flight.toml"]
    return ["replay", *words, "--out", "t.jsonl", "--truth", "truth.csv"]


def _degrees(angles):
    return ",".join(f"{angle:.6f}" for angle in np.degrees(angles))


def lines_of(folder):
    return [json.loads(line) for line in (folder / "t.jsonl").read_text().splitlines()]


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


WITHOUT_BIASES = [
    word
    for key in ("position_bias_m", "height_bias_m", "heading_bias_deg", "mount_bias_deg")
    for word in ("--set", f"uncertainty.{key}=0")
]


def fixes_of(folder):
    return [line["fix"] for line in lines_of(folder) if line["type"] == "target" and line["fix"]]


def nadir_words(folder, sigmas, *, config=FIXED, head=""):
    """One picture straight down over the target, north up."""
    angles = np.array([0.0, -np.pi / 2, 0.0])
    place = moved(TARGET, (0.0, 0.0, -60.0))
    words = written(folder, [((place, angles), (place, angles))], config=config, sigmas=sigmas)
    (folder / "poses.csv").write_text(head + (folder / "poses.csv").read_text())
    return words


def test_an_attitude_error_at_the_nadir_counts_about_both_tilt_axes(tmp_path):
    run_command(*nadir_words(tmp_path, ",0,0,0.5"), *WITHOUT_BIASES, folder=tmp_path)
    cov = np.array(fixes_of(tmp_path)[0]["cov"])
    tilt = 60.0 * np.radians(0.5)
    pixel = 60.0 / 3000.0
    assert np.sqrt(np.diag(cov)[:2]) == pytest.approx([np.hypot(tilt, pixel)] * 2, rel=1e-3)


def test_a_mount_error_at_the_nadir_counts_about_both_tilt_axes(tmp_path):
    words = nadir_words(tmp_path, ",0,0,0")
    run_command(*words, *WITHOUT_BIASES, "--set", "uncertainty.mount_bias_deg=0.5", folder=tmp_path)
    tilt = np.hypot(60.0 * np.radians(0.5), 60.0 / 3000.0)
    assert np.sqrt(np.diag(np.array(fixes_of(tmp_path)[0]["cov"]))[:2]) == pytest.approx([tilt] * 2, rel=1e-3)


def test_equal_row_sigmas_average_out_over_the_pictures(tmp_path):
    """They are each picture's own; as one bias shared by all (`# sigmas: total`) they do not."""
    spread = {}
    for head in ("", "# sigmas: total\n"):
        words = written(tmp_path, photographs(40), sigmas=",1.0,0.1,0.0")
        (tmp_path / "poses.csv").write_text(head + (tmp_path / "poses.csv").read_text())
        held = ("--set", "uncertainty.position_bias_time_s=1e6")  # a bias does not wander
        done = run_command(*words, *WITHOUT_BIASES, *held, folder=tmp_path)
        assert done.returncode == 0, done.stderr
        assert ("NOTE" in done.stderr or "each picture's own" in done.stderr) == (head == "")
        spread[head] = np.sqrt(lines_of(tmp_path)[-2]["cov"][0][0])
    assert spread[""] < 0.4  # 1 / sqrt(40), and a floor for what the tracker cannot know
    assert spread["# sigmas: total\n"] > 0.9


def test_an_altitude_above_the_ellipsoid_is_brought_to_the_geoid(tmp_path):
    from fwav_companion.geoid import egm96

    undulation = egm96().undulation_m(TARGET[0], TARGET[1])
    assert undulation == pytest.approx(46.0, abs=1.5)  # Munich, EGM96
    config = FIXED.replace('"fixed"', '"altitude"').replace("height_m = 60.0", f"alt_amsl = {TARGET[2]}")
    words = written(tmp_path, photographs(6), config=config)
    text = (tmp_path / "poses.csv").read_text().replace("alt_amsl", "alt").splitlines()
    columns = text[0].split(",").index("alt")
    rows = [row.split(",") for row in text[1:]]
    for row in rows:
        row[columns] = f"{float(row[columns]) + undulation:.3f}"
    body = "\n".join(["# alt_datum: ellipsoid", text[0], *(",".join(row) for row in rows)])
    (tmp_path / "poses.csv").write_text(body + "\n")
    done = run_command(*words, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert lines_of(tmp_path)[-1]["errors"]["fixes"]["all"]["rms_m"] < 0.02


def test_poses_above_the_take_off_are_over_its_ground_with_relief(tmp_path):
    """alt_datum takeoff with takeoff_alt, [ground] home: the ground may be 4 m off, and the claim says so."""
    config = FIXED.replace('"fixed"', '"home"').replace("height_m = 60.0", "")
    words = written(tmp_path, photographs(6), config=config)
    text = (tmp_path / "poses.csv").read_text().replace("alt_amsl", "alt").splitlines()
    columns = text[0].split(",").index("alt")
    rows = [row.split(",") for row in text[1:]]
    for row in rows:
        row[columns] = f"{float(row[columns]) - TARGET[2]:.3f}"
    body = "\n".join([text[0] + ",alt_datum,takeoff_alt", *(",".join(row) + f",takeoff,{TARGET[2]}" for row in rows)])
    (tmp_path / "poses.csv").write_text(body + "\n")
    done = run_command(*words, *WITHOUT_BIASES, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert lines_of(tmp_path)[-1]["errors"]["fixes"]["all"]["rms_m"] < 0.02
    assert 3.9 < np.sqrt(fixes_of(tmp_path)[0]["cov"][2][2]) < 4.2


def test_the_claim_of_a_fix_is_that_of_its_row(tmp_path):
    sigmas = (0.8, 0.5, np.radians(0.7))
    config = FIXED.replace('"fixed"', '"terrain"').replace("height_m = 60.0", TERRAIN)
    pictures = list(photographs(60, sigmas=sigmas))
    words = written(tmp_path, pictures, config=config, sigmas=",0.8,0.5,0.7")
    flat_model(tmp_path)
    done = run_command(*words, *WITHOUT_BIASES, "--set", "uncertainty.terrain_m=0.01", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    errors = lines_of(tmp_path)[-1]["errors"]["fixes"]["all"]
    assert errors["samples"] == 60
    assert 0.8 < errors["rms_m"] < 2.5
    assert 1.3 < errors["nees"] < 2.8  # 2 +- 3 * 2 / sqrt(60)


def test_a_row_with_a_worse_place_claims_less_and_the_others_stay(tmp_path):
    pictures = list(photographs(4))
    words = written(tmp_path, pictures, sigmas=",0.1,0.1,0.1")
    run_command(*words, folder=tmp_path)
    before = [line["fix"]["cov"] for line in lines_of(tmp_path) if line["type"] == "target" and line["fix"]]
    rows = (tmp_path / "poses.csv").read_text().splitlines()
    rows[2] = rows[2].replace(",0.1,0.1,0.1", ",5.0,0.1,0.1")
    (tmp_path / "poses.csv").write_text("\n".join(rows))
    run_command(*words, folder=tmp_path)
    after = [line["fix"]["cov"] for line in lines_of(tmp_path) if line["type"] == "target" and line["fix"]]
    assert np.trace(np.subtract(after[1], before[1])) == pytest.approx(2 * (5.0**2 - 0.1**2), rel=1e-6)
    assert np.allclose(after[0], before[0])
    assert np.allclose(after[2:], before[2:])


TERRAIN = 'terrain = ["N48E011.hgt"]\nterrain_datum = "egm96"'


def flat_model(folder):
    np.full((1201, 1201), TARGET[2], dtype=">i2").tofile(folder / "N48E011.hgt")


def test_an_elevation_model_is_not_moved(tmp_path):
    config = FIXED.replace('"fixed"', '"terrain"').replace("height_m = 60.0", TERRAIN)
    flat_model(tmp_path)
    done = run_command(*written(tmp_path, photographs(8, height_m=80.0), config=config), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    summary = lines_of(tmp_path)[-1]
    assert summary["fixes"] == 8
    assert summary["errors"]["fixes"]["all"]["rms_m"] < 0.01


def test_an_elevation_model_above_the_ellipsoid_is_brought_to_the_geoid(tmp_path):
    from fwav_companion.geoid import egm96

    config = FIXED.replace('"fixed"', '"terrain"').replace("height_m = 60.0", TERRAIN.replace("egm96", "ellipsoid"))
    above = TARGET[2] + egm96().undulation_m(TARGET[0], TARGET[1])
    np.full((1201, 1201), round(above), dtype=">i2").tofile(tmp_path / "N48E011.hgt")
    done = run_command(*written(tmp_path, photographs(8, height_m=80.0), config=config), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert lines_of(tmp_path)[-1]["errors"]["fixes"]["all"]["rms_m"] < 0.6  # the model has whole metres


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


def test_poses_above_an_unknown_take_off_have_no_altitude_above_the_sea(tmp_path):
    config = FIXED.replace('"fixed"', '"home"').replace("height_m = 60.0", "")
    words = written(tmp_path, photographs(6), config=config)
    text = (tmp_path / "poses.csv").read_text().replace("alt_amsl", "alt").splitlines()
    column = text[0].split(",").index("alt")
    rows = [row.split(",") for row in text[1:]]
    for row in rows:
        row[column] = f"{float(row[column]) - TARGET[2]:.3f}"
    (tmp_path / "poses.csv").write_text(
        "\n".join([text[0], *(",".join(row) for row in rows)]) + "\n# alt_datum: takeoff\n"
    )
    exports = [word for name in ("kml", "gpx", "geojson", "csv") for word in ("--export", f"a.{name}")]
    words = [word for word in words if word not in ("--truth", "truth.csv")]
    done = run_command(*words, *exports, "--report", "r", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    lines = lines_of(tmp_path)
    assert lines[0]["origin"]["alt_amsl"] is None
    targets = [line for line in lines if line["type"] == "target"]
    assert {line["alt_amsl"] for line in targets} == {None}
    assert targets[-1]["alt_takeoff"] == pytest.approx(0.0, abs=0.01)
    assert "m from the take-off" in (tmp_path / "a.kml").read_text()
    wrong = tmp_path / "flight.toml"
    wrong.write_text(wrong.read_text().replace('"home"', '"altitude"\nalt_amsl = 519.0'))
    done = run_command(*words, folder=tmp_path)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "--takeoff-alt" in done.stderr


@pytest.mark.parametrize("stated", [False, True])
def test_biases_of_the_pictures_source_count_unless_the_configuration_states_them(tmp_path, stated):
    words = nadir_words(tmp_path, ",0,0,0")
    text = (tmp_path / "poses.csv").read_text().splitlines()
    (tmp_path / "poses.csv").write_text(f"{text[0]},position_bias_m,mount_bias_deg\n{text[1]},2.0,0.25\n")
    more = ("--set", "uncertainty.position_bias_m=0.5", "--set", "uncertainty.mount_bias_deg=auto") if stated else ()
    done = run_command(*words, *more, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    tilt, pixel, place = 60.0 * np.radians(0.25), 60.0 / 3000.0, 0.5 if stated else 2.0
    cov = np.array(fixes_of(tmp_path)[0]["cov"])
    assert np.sqrt(np.diag(cov)[:2]) == pytest.approx([np.sqrt(tilt**2 + pixel**2 + place**2)] * 2, rel=2e-3)


def test_a_heading_error_of_all_pictures_is_reported_from_several_sides(tmp_path):
    """All poses are turned by 5 degrees about the vertical: the summary says so, with its sigma."""
    turned = []
    for (place, angles), (claimed, euler) in photographs(30):
        turned.append(((place, angles), (claimed, (euler[0], euler[1], euler[2] + np.radians(5.0)))))
    config = FIXED.replace('"fixed"', '"altitude"').replace("height_m = 60.0", f"alt_amsl = {TARGET[2]}")
    done = run_command(*written(tmp_path, turned, config=config, sigmas=",0.1,0.1,0.1"), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    shared = {each["error"]: each for each in lines_of(tmp_path)[-1]["shared_errors"]}
    # written there: heading_bias_deg 2, mount_bias_deg 1; the rotation about the axis of a camera that looks down is
    # shared between both in the ratio of their variances
    assert "heading" in shared or "mount_z" in shared
    together = sum(shared[name]["value"] for name in ("heading", "mount_z") if name in shared)
    assert together == pytest.approx(5.0, abs=1.5)
    assert "shared by all pictures" in done.stdout


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
