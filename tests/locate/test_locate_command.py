"""`locate` from the command line: answers, files, and one line for every bad input."""

from __future__ import annotations

import json
import random
from pathlib import Path

import numpy as np
import pymap3d
import pytest

from fwav_companion.cli.main import main
from tests.support.maker_pictures import (
    HEIGHT,
    WIDTH,
    pixel_of,
    place_below,
    true_picture,
    write_picture,
)


@pytest.fixture
def picture(tmp_path: Path) -> tuple[Path, str, tuple[float, float]]:
    """A resized RTK picture of 40 x 30 pixels, a pixel of it, and the place that it shows."""
    truth = true_picture(np.random.default_rng(2), pitch=-55.0)
    lat, lon, _ = place_below(truth, 2500.0, 1800.0)
    path = write_picture(tmp_path / "a.jpg", "dji_rtk", truth)
    return path, f"{2500.5 / 100 - 0.5},{1800.5 / 100 - 0.5}", (lat, lon)


def last_json(text: str) -> dict:
    return json.loads(text.strip().splitlines()[-1])


def test_locate_resized_picture_gives_the_place_and_says_so(picture, capsys: pytest.CaptureFixture[str]) -> None:
    path, pixel, (lat, lon) = picture
    assert main(["locate", str(path), "--pixel", pixel, "--json"]) == 0
    out = capsys.readouterr().out
    (target,) = last_json(out)["targets"]
    north, east, _ = pymap3d.geodetic2ned(target["lat"], target["lon"], 0, lat, lon, 0)
    assert np.hypot(north, east) < 0.05
    assert (target["alt_datum"], target["alt_amsl"]) == ("egm96", pytest.approx(400.0, abs=0.05))
    assert "resized from 4000 x 3000" in out
    assert "flat ground at take-off height: give --terrain FILE for hills" in out
    assert "the true ground lies within 4 m of the flat one (one sigma), or 5% of the height above ground" in out
    assert "MGRS" in out
    assert "NOTE: 1 picture cannot show whether its errors are larger than assumed" in out
    assert "1 picture cannot show" in last_json(out)["unverified"]


def test_locate_two_pictures_is_more_certain_than_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(4)
    first = true_picture(rng, lat=47.0, lon=11.0, pitch=-50.0, yaw=0.0, roll=0.0, above_takeoff=60.0, alt_amsl=460.0)
    lat, lon, alt = place_below(first, 2000.0, 1500.0)
    north, east, _ = pymap3d.geodetic2ned(lat, lon, 0.0, 47.0, 11.0, 0.0)
    lat2, lon2, _ = pymap3d.ned2geodetic(north + 50.0, east, 0.0, 47.0, 11.0, 0.0)
    second = true_picture(
        rng, lat=float(lat2), lon=float(lon2), pitch=-50.0, yaw=180.0, roll=0.0, above_takeoff=60.0, alt_amsl=460.0
    )
    radii = []
    for pictures in ([first], [first, second]):
        command = ["locate"]
        for number, each in enumerate(pictures):
            command.append(str(write_picture(tmp_path / f"{number}.jpg", "dji_rtk", each)))
        for each in pictures:
            u, v = pixel_of(each, lat, lon, alt)
            assert 0 < u < WIDTH
            assert 0 < v < HEIGHT
            command += ["--pixel", f"{(u + 0.5) / 100 - 0.5},{(v + 0.5) / 100 - 0.5}"]
        assert main([*command, "--json"]) == 0
        (target,) = last_json(capsys.readouterr().out)["targets"]
        radii.append(target["radius95_m"])
        error = pymap3d.geodetic2ned(target["lat"], target["lon"], 0, lat, lon, 0)
        assert np.hypot(error[0], error[1]) < 0.05
    assert radii[1] < 0.8 * radii[0]


def test_locate_turned_picture_counts_pixels_as_viewed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = true_picture(np.random.default_rng(3), pitch=-60.0)
    lat, lon, _ = place_below(truth, 1000.0, 2000.0)
    path = write_picture(tmp_path / "a.jpg", "dji_rtk", truth, t274=6)  # viewers turn it clockwise
    u, v = 1000.5 / 100 - 0.5, 2000.5 / 100 - 0.5
    assert main(["locate", str(path), "--pixel", f"{29 - v},{u}", "--json"]) == 0
    (target,) = last_json(capsys.readouterr().out)["targets"]
    error = pymap3d.geodetic2ned(target["lat"], target["lon"], 0, lat, lon, 0)
    assert np.hypot(error[0], error[1]) < 0.05


def test_locate_above_the_horizon_ends_with_one_and_the_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_picture(tmp_path / "a.jpg", "dji_rtk", true_picture(np.random.default_rng(3), pitch=5.0))
    assert main(["locate", str(path), "--pixel", "20,5"]) == 1
    assert "above_horizon" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--pixel", "1912"], "--pixel 1912"),
        (["--pixel", "50,10"], "outside its 40 x 30 pixels"),
        ([], "one of --pixel"),
        (["--pixel", "1,1", "--pixel", "2,2"], "2 --pixel for 1 pictures"),
        (["--pixel", "1,1", "--out", "x.shp"], ".kml, .geojson, .csv"),
        (["--pixel", "1,1", "--takeoff", "47,11"], "--takeoff"),
        (["--pixel", "1,1", "--hfov", "200"], "--hfov"),
    ],
)
def test_locate_wrong_arguments_is_one_line(picture, arguments: list[str], said: str, capsys) -> None:
    assert main(["locate", str(picture[0]), *arguments]) == 2
    captured = capsys.readouterr().err
    assert captured.count("\n") == 1
    assert said in captured


def test_locate_broken_pictures_is_one_line(picture, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """0 bytes, text, and 200 mutations of a good picture."""
    good, rng = picture[0].read_bytes(), random.Random(1)
    contents = [b"", b"hello", good[:200]]
    for _ in range(197):
        data = bytearray(good)
        for _ in range(rng.randint(1, 20)):
            data[rng.randrange(min(len(data), 2500))] = rng.randrange(256)
        contents.append(bytes(data[: rng.randrange(1, len(data))] if rng.random() < 0.3 else data))
    path = tmp_path / "b.jpg"
    for content in contents:
        path.write_bytes(content)
        status = main(["locate", str(path), "--pixel", "20,20"])
        captured = capsys.readouterr()
        assert status in (0, 1, 2)
        assert captured.err.count("\n") == (status != 0)


@pytest.mark.parametrize("options", [[], ["--hfov", "70"]])
def test_locate_cropped_picture_asks_for_its_camera(options: list[str], tmp_path: Path, capsys) -> None:
    """40 x 22 pixels of a picture of 4000 x 3000: nothing says where the axis is."""
    from io import BytesIO

    from PIL import Image

    from sitl_mock.maker_tags import LAYOUTS, tagged_jpeg

    jpeg, path = BytesIO(), tmp_path / "a.jpg"
    Image.new("RGB", (40, 22)).save(jpeg, "JPEG")
    xmp, exif = LAYOUTS["dji_rtk"](true_picture(np.random.default_rng(2), pitch=-55.0))
    path.write_bytes(tagged_jpeg(jpeg.getvalue(), xmp, exif, (WIDTH, HEIGHT)))
    assert main(["locate", str(path), "--pixel", "20,20", *options]) == 2
    assert "another shape; give --camera FILE" in capsys.readouterr().err
    (tmp_path / "camera.yaml").write_text(  # as ROS writes it
        "image_width: 40\nimage_height: 22\ncamera_name: a\ndistortion_model: plumb_bob\n"
        "camera_matrix: {rows: 3, cols: 3, data: [27, 0, 19.5, 0, 27, 10.5, 0, 0, 1]}\n"
        "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n"
    )
    assert main(["locate", str(path), "--pixel", "20,20", "--camera", str(tmp_path / "camera.yaml")]) == 0
    assert "lens by --camera" in capsys.readouterr().out


def test_locate_picture_of_a_messenger_is_one_line(tmp_path: Path, capsys) -> None:
    from PIL import Image

    Image.new("RGB", (400, 300)).save(tmp_path / "a.jpg")
    assert main(["locate", str(tmp_path / "a.jpg"), "--pixel", "20,20"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "messengers remove it: use the original file" in error


def test_locate_unknown_datum_is_said_with_its_sigma_and_may_be_given(tmp_path: Path, capsys) -> None:
    """Autel states no datum: taken as above the ellipsoid with 20 m, or as what the user says."""
    path = write_picture(tmp_path / "a.jpg", "autel_new", true_picture(np.random.default_rng(2), pitch=-55.0))
    words = ["locate", str(path), "--pixel", "19.5,14.5", "--ground-alt", "400", "--json"]
    assert main(words) == 0
    unknown = capsys.readouterr().out
    assert "taken as above the ellipsoid (one sigma 20 m); give --alt-datum egm96 or ellipsoid" in unknown
    assert main([*words, "--alt-datum", "ellipsoid"]) == 0
    known = capsys.readouterr().out
    assert "--alt-datum" not in known
    heights = [last_json(out)["targets"][0]["budget_m"]["shared_height"] for out in (unknown, known)]
    assert heights[1] == pytest.approx(heights[0] / 4.0)  # 5 m of a consumer's GNSS


def test_locate_pixels_of_ground_control_fuses_one_label(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = true_picture(np.random.default_rng(8), pitch=-70.0)
    write_picture(tmp_path / "a.jpg", "dji_rtk", truth)
    (tmp_path / "gcp_list.txt").write_text("EPSG:32632\n1 2 3 20.5 15.5 a.jpg corner\n1 2 4 10.5 12.5 a.jpg\n")
    arguments = [str(tmp_path / "a.jpg"), "--pixels", str(tmp_path / "gcp_list.txt"), "--json"]
    assert main(["locate", *arguments]) == 0
    targets = last_json(capsys.readouterr().out)["targets"]
    assert [target["label"] for target in targets] == ["corner", "point 1"]
    lat, lon, _ = place_below(truth, 20.5 * 100 - 0.5, 15.5 * 100 - 0.5)
    error = pymap3d.geodetic2ned(targets[0]["lat"], targets[0]["lon"], 0, lat, lon, 0)
    assert np.hypot(error[0], error[1]) < 0.05


def test_locate_detect_finds_the_tag_where_it_lies(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from io import BytesIO

    from PIL import Image

    from sitl_mock.maker_tags import LAYOUTS, tagged_jpeg
    from tests.vision.vision_pictures import tag_picture

    truth = true_picture(np.random.default_rng(6), pitch=-70.0, width=640, height=480, focal_px=640 * 24 / 36)
    jpeg = BytesIO()
    Image.fromarray(tag_picture((300.0, 200.0), side_px=90.0)).save(jpeg, "JPEG", quality=95)
    xmp, exif = LAYOUTS["dji_rtk"](truth)
    (tmp_path / "a.jpg").write_bytes(tagged_jpeg(jpeg.getvalue(), xmp, exif, (640, 480)))
    assert main(["init", str(tmp_path)]) == 0
    config = tmp_path / "fwav-companion.toml"
    config.write_text(config.read_text() + '[vision]\nsource = "pictures"\n')
    assert main(["locate", str(tmp_path / "a.jpg"), "--detect", "--config", str(config), "--json"]) == 0
    (target,) = last_json(capsys.readouterr().out)["targets"]
    assert target["label"].startswith("tag36h11")
    lat, lon, _ = place_below(truth, 300.0, 200.0)
    error = pymap3d.geodetic2ned(target["lat"], target["lon"], 0, lat, lon, 0)
    assert np.hypot(error[0], error[1]) < 0.2


def test_locate_config_counts_what_it_states_and_not_its_defaults(picture, tmp_path: Path, capsys) -> None:
    path, pixel, _ = picture
    heading = {}
    for stated in ("", "[uncertainty]\nheading_bias_deg = 8.0\n"):
        config = tmp_path / "c.toml"
        config.write_text(
            '[[link]]\nname = "a"\nurl = "udpin://127.0.0.1:1"\nrole = "autopilot"\n[detections]\nurl = ""\n' + stated
        )
        assert main(["locate", str(path), "--pixel", pixel, "--config", str(config), "--json"]) == 0
        heading[stated] = last_json(capsys.readouterr().out)["targets"][0]["budget_m"]["heading"]
    first, second = heading.values()
    assert second == pytest.approx(8.0 * first, rel=1e-3)  # RTK: 1 degree by source


def test_locate_over_terrain_gives_the_hill(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A plane that rises to the east by 0.2: an RTK picture, whose height above the ellipsoid is converted."""
    truth = true_picture(
        np.random.default_rng(1),
        lat=47.5,
        lon=11.5,
        yaw=90.0,
        pitch=-45.0,
        roll=0.0,
        alt_amsl=700.0,
        above_takeoff=90.0,
    )
    columns = np.arange(1201) / 1200.0
    east_m = (columns - 0.5) * np.cos(np.radians(47.5)) * 111_320.0
    heights = np.tile(np.clip(600.0 + 0.2 * east_m, -400, 8000), (1201, 1))
    np.round(heights).astype(">i2").tofile(tmp_path / "N47E011.hgt")
    path = write_picture(tmp_path / "a.jpg", "dji_rtk", truth)
    arguments = ["locate", str(path), "--pixel", "19.5,14.5", "--terrain", str(tmp_path / "N47E011.hgt"), "--json"]
    assert main(arguments) == 0
    (target,) = last_json(capsys.readouterr().out)["targets"]
    # 100 m above the ground below, looking 45 degrees down to the east: e = 100 - 0.2 e
    _, east, _ = pymap3d.geodetic2ned(target["lat"], target["lon"], 0, 47.5, 11.5, 0)
    assert east == pytest.approx(100.0 / 1.2, abs=1.5)  # whole metres of the model
    assert target["alt_amsl"] == pytest.approx(600.0 + 0.2 * 100.0 / 1.2, abs=1.0)


def test_locate_consumer_over_terrain_warns_without_a_take_off(tmp_path: Path, capsys) -> None:
    truth = true_picture(np.random.default_rng(1), lat=47.5, lon=11.5, pitch=-60.0, alt_amsl=700.0, above_takeoff=100.0)
    np.full((1201, 1201), 600, dtype=">i2").tofile(tmp_path / "N47E011.hgt")
    path = write_picture(tmp_path / "a.jpg", "dji_consumer", truth)  # its absolute altitude is 41 m too low
    base = ["locate", str(path), "--pixel", "19.5,14.5", "--terrain", str(tmp_path / "N47E011.hgt")]
    assert main([*base, "--json"]) == 0
    out = capsys.readouterr().out
    assert "WARNING: the absolute altitude counts with 30 m" in out
    wide = last_json(out)["targets"][0]
    assert main([*base, "--takeoff", "47.5,11.5", "--json"]) == 0
    out = capsys.readouterr().out
    assert "-41 m from take-off plus relative height" in out
    lat, lon, _ = place_below(truth, 1999.5, 1499.5)
    target = last_json(out)["targets"][0]
    error = pymap3d.geodetic2ned(target["lat"], target["lon"], 0, lat, lon, 0)
    assert np.hypot(error[0], error[1]) < 0.1
    assert target["ellipse95_major_m"] < 0.7 * wide["ellipse95_major_m"]
