"""Tables of poses of photogrammetry programs: written by scipy's rotations and by UTM of pymap3d's or our oracle."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pymap3d
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from fwav_companion.cli.main import main
from fwav_companion.errors import InputFileError
from fwav_companion.geometry.map_grid import degrees_from_transverse_mercator, transverse_mercator
from fwav_companion.photographs.picture_pose import PicturePose
from fwav_companion.photographs.pose_tables import parse_pose_table
from fwav_companion.photographs.table_crs import table_crs
from fwav_companion.photographs.table_poses import poses_of_table
from tests.support.maker_pictures import ned_from_camera, place_below, true_picture

ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FLIP = np.diag([1.0, -1.0, -1.0])
EPSG = "EPSG:32632"
MERIDIAN = 9.0


def pictures(count: int = 20) -> list:
    """Poses in zone 32, up to 3 degrees from its meridian, where grid north is 2 degrees from true north."""
    rng = np.random.default_rng(11)
    return [true_picture(rng, lat=float(rng.uniform(40, 60)), lon=float(rng.uniform(6.5, 11.9))) for _ in range(count)]


def utm(picture) -> tuple[float, float]:
    east, north = transverse_mercator(picture.lat, picture.lon, MERIDIAN)
    return 500_000.0 + east, north


def grid_from_camera(picture) -> np.ndarray:
    """East, north, up of the grid from the camera's axes; the grid's north is measured along a short northward step."""
    step = 1e-4
    first = np.array(transverse_mercator(picture.lat - step, picture.lon, MERIDIAN))
    east, north = np.array(transverse_mercator(picture.lat + step, picture.lon, MERIDIAN)) - first
    true_north_from_grid_north = np.arctan2(east, north)  # clockwise
    enu = ENU_FROM_NED @ ned_from_camera(picture)
    return Rotation.from_euler("z", -true_north_from_grid_north).as_matrix() @ enu


def opk(picture) -> np.ndarray:
    return Rotation.from_matrix(grid_from_camera(picture) @ FLIP).as_euler("XYZ", degrees=True)


def nadir_ypr(picture) -> tuple[float, float, float]:
    """Yaw, pitch, roll of a body with a camera that looks down, image top forward."""
    body_from_camera = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    yaw, pitch, roll = Rotation.from_matrix(ned_from_camera(picture) @ body_from_camera.T).as_euler("ZYX", degrees=True)
    return yaw, pitch, roll


def pix4d(all_of) -> str:
    rows = [f"{i}.jpg {utm(p)[0]:.4f} {utm(p)[1]:.4f} {p.alt_amsl:.4f} " + " ".join(f"{a:.9f}" for a in opk(p))
            for i, p in enumerate(all_of)]  # fmt: skip
    return "imageName X Y Z Omega Phi Kappa\n" + "\n".join(rows) + "\n"


def metashape(all_of) -> str:
    rows = [f"{i}.jpg,{utm(p)[0]:.4f},{utm(p)[1]:.4f},{p.alt_amsl:.4f}," + ",".join(f"{a:.9f}" for a in opk(p))
            + ",1,0,0,0,1,0,0,0,1" for i, p in enumerate(all_of)]  # fmt: skip
    return "# Cameras (20)\n# PhotoID, X, Y, Z, Omega, Phi, Kappa, r11, r12\n" + "\n".join(rows)


def reference(all_of) -> str:
    rows = [f"{i}.jpg,{p.lon:.9f},{p.lat:.9f},{p.alt_amsl:.4f}," + ",".join(f"{a:.9f}" for a in nadir_ypr(p))
            for i, p in enumerate(all_of)]  # fmt: skip
    return "# CoordinateSystem: EPSG::4326\n#Label,X/Longitude,Y/Latitude,Z/Altitude,Yaw,Pitch,Roll\n" + "\n".join(rows)


def geo_txt(all_of) -> str:
    rows = [f"{i}.jpg {p.lon:.9f} {p.lat:.9f} {p.alt_amsl:.4f} " + " ".join(f"{a:.9f}" for a in nadir_ypr(p))
            + " 0.5 0.8" for i, p in enumerate(all_of)]  # fmt: skip
    return "EPSG:4326\n" + "\n".join(rows)


def shots(all_of) -> str:
    features = []
    for i, p in enumerate(all_of):
        turn = Rotation.from_matrix(grid_from_camera(p).T).as_rotvec()
        features.append({"type": "Feature", "properties": {"filename": f"{i}.jpg", "rotation": turn.tolist()},
                         "geometry": {"type": "Point", "coordinates": [p.lon, p.lat, p.alt_amsl]}})  # fmt: skip
    return json.dumps({"type": "FeatureCollection", "features": features})


def pix4d_matrices(all_of) -> str:
    lines = ["fileName imageWidth imageHeight", "camera matrix K [3x3]", "radial distortion [3x1]", ""]
    for i, p in enumerate(all_of):
        r = grid_from_camera(p).T
        lines += [f"{i}.jpg 4000 3000", "2666 0 2000", "0 2666 1500", "0 0 1", "0 0 0", "0 0",
                  f"{utm(p)[0]:.4f} {utm(p)[1]:.4f} {p.alt_amsl:.4f}",
                  *(" ".join(f"{x:.12f}" for x in row) for row in r)]  # fmt: skip
    return "\n".join(lines)


TABLES = [pix4d, metashape, reference, geo_txt, shots, pix4d_matrices]


@pytest.mark.parametrize("write", TABLES)
def test_table_gives_the_poses_that_it_was_written_from(write):
    truth = pictures()
    poses = poses_of_table(parse_pose_table(write(truth), "t.txt"), "t.txt", table_crs(EPSG))
    assert len(poses) == len(truth)
    for i, picture in enumerate(truth):
        pose = poses[f"{i}.jpg"]
        assert isinstance(pose, PicturePose)
        away = pymap3d.geodetic2ned(pose.lat_deg, pose.lon_deg, 0.0, picture.lat, picture.lon, 0.0)
        assert np.hypot(*away[:2]) < 1e-3
        assert pose.absolute is not None
        assert pose.absolute.metres == pytest.approx(picture.alt_amsl, abs=1e-3)
        angles = [pose.yaw_deg, pose.pitch_deg, pose.roll_deg]
        given = Rotation.from_euler("ZYX", angles, degrees=True)
        true = Rotation.from_euler("ZYX", [picture.yaw, picture.pitch, picture.roll], degrees=True)
        assert np.degrees((given.inv() * true).magnitude()) < 0.005  # the convergence is the sphere's


@pytest.mark.parametrize("write", [pix4d, metashape, pix4d_matrices])
def test_table_without_a_coordinate_system_is_refused_with_its_first_line(write):
    text = write(pictures(1))
    with pytest.raises(InputFileError, match="--poses-crs") as refused:
        poses_of_table(parse_pose_table(text, "t.txt"), "t.txt", None)
    assert text.splitlines()[0][:40] in str(refused.value)


@pytest.mark.parametrize(
    "text", ["", "hello\n1 2 3\n", "EPSG:28992\na.jpg 1 2 3\n", "# IMAGE_ID, QW, QX, QY, QZ\n1 1 0 0 0 0 0 0 1 a.jpg\n"]
)
def test_unknown_table_is_refused_with_its_first_line(text: str):
    with pytest.raises(InputFileError, match="accepted") as refused:
        parse_pose_table(text, "t.txt")
    assert text.split("\n")[0] in str(refused.value)


@pytest.mark.parametrize("write", TABLES)
def test_mutated_table_gives_poses_or_one_line(write):
    rng = np.random.default_rng(7)
    text = write(pictures(3))
    for _ in range(200):
        changed = list(text)
        for at in rng.integers(0, len(changed), int(rng.integers(1, 6))):
            changed[at] = chr(int(rng.choice([0, 10, 32, 34, 44, 45, 46, 57, 101, 123, 233])))
        try:
            poses = poses_of_table(parse_pose_table("".join(changed), "t.txt"), "t.txt", table_crs(EPSG))
        except InputFileError as error:
            if "\n" in str(error):
                pytest.fail(str(error))
        else:
            assert all(isinstance(pose, PicturePose) or pose.place for pose in poses.values())


def test_inverse_projection_returns_the_place():
    rng = np.random.default_rng(3)
    for lat, lon in zip(rng.uniform(-80, 84, 200), rng.uniform(-3.5, 3.5, 200), strict=True):
        assert degrees_from_transverse_mercator(*transverse_mercator(lat, 9 + lon, 9.0), 9.0) == pytest.approx(
            (lat, 9 + lon), abs=1e-10
        )
    with pytest.raises(ValueError, match="not a place"):
        degrees_from_transverse_mercator(9e7, 1e6, 9.0)


def test_locate_takes_the_poses_of_a_table_for_pictures_without_tags(tmp_path: Path, capsys):
    truth = true_picture(np.random.default_rng(1), lat=47.0, lon=11.0, pitch=-60.0, width=400, height=300,
                         focal_px=400 * 24 / 36)  # fmt: skip
    Image.new("RGB", (400, 300)).save(tmp_path / "0.jpg")
    (tmp_path / "poses.txt").write_text(pix4d([truth]))
    lat, lon, _ = place_below(truth, 250.0, 180.0)
    command = ["locate", str(tmp_path / "0.jpg"), "--pixel", "250,180", "--poses", str(tmp_path / "poses.txt"),
               "--hfov", f"{2 * np.degrees(np.arctan(200 / truth.focal_px)):.9f}", "--ground-alt", "400"]  # fmt: skip
    assert main([*command, "--json"]) == 2
    assert "--poses-crs" in capsys.readouterr().err
    assert main([*command, "--poses-crs", EPSG, "--alt-datum", "egm96", "--json"]) == 0
    out = capsys.readouterr().out
    (target,) = json.loads(out.splitlines()[-1])["targets"]
    assert np.hypot(*pymap3d.geodetic2ned(target["lat"], target["lon"], 0.0, lat, lon, 0.0)[:2]) < 0.05
    assert "pose by Pix4D" in out


def test_geo_txt_without_angles_keeps_those_of_the_tags(tmp_path: Path, capsys):
    from tests.support.maker_pictures import write_picture

    truth = true_picture(np.random.default_rng(2), pitch=-55.0)
    path = write_picture(tmp_path / "a.jpg", "dji_rtk", truth)
    (tmp_path / "geo.txt").write_text(f"EPSG:4326\na.jpg {truth.lon + 0.001:.9f} {truth.lat:.9f} {truth.alt_amsl}\n")
    _, lon, _ = place_below(truth, 2500.0, 1800.0)
    pixel = f"{2500.5 / 100 - 0.5},{1800.5 / 100 - 0.5}"
    command = ["locate", str(path), "--pixel", pixel, "--poses", str(tmp_path / "geo.txt"), "--json"]
    assert main(command) == 0
    (target,) = json.loads(capsys.readouterr().out.splitlines()[-1])["targets"]
    assert target["lon"] - lon == pytest.approx(0.001, abs=1e-6)
