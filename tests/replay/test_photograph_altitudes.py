"""`replay --poses`: altitudes of pictures and ground by their datums."""

import numpy as np
import pytest
from commands import run_command
from posed_pictures import FIXED, TARGET, TERRAIN, WITHOUT_BIASES, fixes_of, flat_model, lines_of, photographs, written


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
